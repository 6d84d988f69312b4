"""Renderers of others in the same scene, against the same reference: Cycles and LuxCore, in processes of their own."""
