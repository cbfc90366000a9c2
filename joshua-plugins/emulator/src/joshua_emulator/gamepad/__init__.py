"""An emulated gamepad: the kernel's input records on a UNIX socket."""
