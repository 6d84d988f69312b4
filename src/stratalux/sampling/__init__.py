"""Drawing directions and their densities, in Dr.Jit: tables uploaded once; no scenes and no BSDFs."""
