"""Labelled pictures -> wallkit's own semantic network, by PyTorch, and how well it does."""
