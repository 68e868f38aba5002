"""How completions are judged: published protocols, windows of held-out performers, tables."""
