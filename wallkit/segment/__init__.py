"""A camera's picture -> a class for every pixel and every LiDAR point, by an ONNX model or from recorded masks."""
