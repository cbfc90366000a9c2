"""Policies as ONNX: exported once, run by onnxruntime without PyTorch."""
