"""A machine whose files lie in a temporary folder."""

from usb_host import make_host as make_host
