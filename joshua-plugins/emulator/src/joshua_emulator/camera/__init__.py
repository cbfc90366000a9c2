"""An emulated camera: a process that serves Motion JPEG over HTTP on loopback, as network cameras do."""
