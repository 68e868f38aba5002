"""One file a network, each readable from top to bottom. Needs torch; users run the exported ONNX graphs."""
