"""An emulated gamepad: what the kernel would hand over, on a UNIX socket."""
