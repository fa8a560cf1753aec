"""The body as one closed mechanism: coupling graph, virtual chains, circuits, network matrix."""
