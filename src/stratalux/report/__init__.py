"""Self-contained HTML reports of comparisons and of the paper's reproduction."""
