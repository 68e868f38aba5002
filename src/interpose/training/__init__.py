"""How networks are trained: windows of packed data, the loop, and one recipe a network. Needs torch."""
