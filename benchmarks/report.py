"""The page of ``docs/benchmarks.md`` from the ``results.json`` of ``stratalux bench``, on standard output."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stratalux import InputError
from stratalux.bench import BenchResult
from stratalux.bench.markdown import markdown


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, metavar="RESULTS.json")
    try:
        print(markdown(BenchResult.read(parser.parse_args().results)), end="")
    except InputError as error:
        sys.exit(f"benchmarks.report: error: {error}")


if __name__ == "__main__":
    main()
