"""Cameras read by OpenCV: devices, network streams, video files and numbered pictures."""
