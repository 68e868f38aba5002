"""Rotations, kinematics, ground plane and time, for NumPy arrays and torch tensors alike."""
