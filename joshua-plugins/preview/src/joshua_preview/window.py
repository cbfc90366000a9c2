"""The window of a preview, as a program: pictures come on standard input, and its end closes the window.

Each picture is a head of two lengths (of the caption and of the image), the caption in UTF-8, and a PPM file.
"""

from __future__ import annotations

import struct
import sys
import threading

HEAD = struct.Struct(">II")

_REFRESH_MS = 20


class Inbox:
    """Reads pictures on a thread and keeps the newest one."""

    def __init__(self) -> None:
        self.newest: tuple[str, bytes] | None = None
        self.ended = False
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        stream = sys.stdin.buffer
        while len(head := stream.read(HEAD.size)) == HEAD.size:
            caption_length, image_length = HEAD.unpack(head)
            caption = stream.read(caption_length).decode(errors="replace")
            self.newest = (caption, stream.read(image_length))
        self.ended = True


def main() -> int:
    """Show pictures until the window is closed or the input ends."""
    import tkinter

    try:
        window = tkinter.Tk()
    except tkinter.TclError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    window.title(sys.argv[1] if len(sys.argv) > 1 else "sensor")
    picture = tkinter.Label(window, borderwidth=0)
    picture.pack()
    line = tkinter.Label(window, anchor="w")
    line.pack(fill="x")
    inbox = Inbox()
    kept: list[tkinter.PhotoImage] = []  # Tk itself keeps no reference to an image

    def refresh() -> None:
        if inbox.ended:
            window.destroy()
            return
        newest, inbox.newest = inbox.newest, None
        if newest is not None:
            caption, data = newest
            kept[:] = [tkinter.PhotoImage(master=window, data=data, format="PPM")]
            picture.configure(image=kept[0])
            line.configure(text=caption)
        window.after(_REFRESH_MS, refresh)

    refresh()
    window.mainloop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
