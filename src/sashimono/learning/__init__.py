"""Learned sequence inference: PAST, its ablations and baselines. All but inference needs the extra ``train``."""
