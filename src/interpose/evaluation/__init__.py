"""How completions are judged: metrics, published protocols, tables."""
