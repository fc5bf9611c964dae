"""An X server of a test's own, and what is on its screen."""
import contextlib
import ctypes
import ctypes.util
import os
import shutil
import subprocess

import numpy


class Image(ctypes.Structure):
    """The first fields of Xlib's XImage."""
    _fields_ = [("width", ctypes.c_int), ("height", ctypes.c_int), ("xoffset", ctypes.c_int), ("format", ctypes.c_int),
                ("data", ctypes.c_void_p), ("byte_order", ctypes.c_int), ("bitmap_unit", ctypes.c_int),
                ("bitmap_bit_order", ctypes.c_int), ("bitmap_pad", ctypes.c_int), ("depth", ctypes.c_int),
                ("bytes_per_line", ctypes.c_int), ("bits_per_pixel", ctypes.c_int)]


class Screen:
    """A connection to a display of 24 bits."""

    def __init__(self, display):
        self.x = ctypes.CDLL(ctypes.util.find_library("X11"))
        self.x.XOpenDisplay.restype = self.x.XDefaultRootWindow.restype = ctypes.c_void_p
        self.x.XDefaultRootWindow.argtypes = self.x.XCloseDisplay.argtypes = self.x.XFree.argtypes = [ctypes.c_void_p]
        self.x.XGetImage.restype = ctypes.POINTER(Image)
        self.x.XGetImage.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_uint,
                                     ctypes.c_uint, ctypes.c_ulong, ctypes.c_int]
        self.display = self.x.XOpenDisplay(display.encode())
        assert self.display, display

    def green(self, x, y, width, height):
        """What is there at one moment, [height, width]."""
        planes, whole_pixels = 0xFFFFFFFF, 2
        got = self.x.XGetImage(self.display, self.x.XDefaultRootWindow(self.display), x, y, width, height, planes,
                               whole_pixels)
        image = got.contents
        rows = numpy.frombuffer(ctypes.string_at(image.data, image.bytes_per_line * height), numpy.uint8)
        self.x.XFree(image.data)
        self.x.XFree(got)
        return rows.reshape(height, -1, 4)[:, :width, 1]

    def close(self):
        self.x.XCloseDisplay(self.display)


@contextlib.contextmanager
def server(command):
    """Starts an X server that tells its number to descriptor 3, as the command's -displayfd says; gives its display, or
    None where there is no such server here."""
    if shutil.which(command[0]) is None:
        yield None
        return
    read, write = os.pipe()
    with subprocess.Popen(["sh", "-c", f'exec "$@" 3>&{write}', "sh", *command], pass_fds=[write],
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        os.close(write)
        with os.fdopen(read) as told:
            number = told.readline().strip()
        try:
            yield f":{number}" if number else None
        finally:
            process.terminate()


def xvfb(width, height):
    return server(["Xvfb", "-displayfd", "3", "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp", "-noreset"])
