#!/usr/bin/env python3
"""Writes the printable charts beside this script: A4, in millimetres. Print at 100 %, never "fit to page"."""
import math
import pathlib

FOLDER = pathlib.Path(__file__).parent


def page(name, width, height, title, parts):
    """An SVG of a page, its title and a ruler of 100 mm at the bottom."""
    x, y = (width - 100) / 2, height - 9
    ruler = [f'<path d="M{x} {y}h100" stroke="#000" stroke-width=".25"/>']
    ruler += [f'<path d="M{x + k:g} {y}v{-3 if k % 10 == 0 else -1.5:g}" stroke="#000" stroke-width=".2"/>'
              for k in range(0, 101, 5)]
    ruler.append(f'<text x="{width / 2:g}" y="{y + 5:g}" font-size="3.6" text-anchor="middle">'
                 f'{title} The ruler is 100 mm: measure it.</text>')
    (FOLDER / name).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}" '
        f'font-family="sans-serif">\n<rect width="{width}" height="{height}" fill="#fff"/>\n'
        + "\n".join(parts + ruler) + "\n</svg>\n")


def chessboard(side=25, columns=10, rows=7):
    left, top = (297 - side * columns) / 2, 8
    cells = "".join(f"M{left + side * i:g} {top + side * j:g}h{side}v{side}h{-side}z"
                    for j in range(rows) for i in range(columns) if (i + j) % 2 == 0)
    page("chessboard-a4.svg", 297, 210, f"Chessboard: {columns - 1} x {rows - 1} inner corners, squares of {side} mm.",
         [f'<path d="{cells}" fill="#000"/>'])


def wedge(steps=12):
    """Steps of equal lightness as printers see it: codes of sRGB."""
    width = 260 / steps
    parts = []
    for k in range(steps):
        code = round(255 * k / (steps - 1))
        x = 18.5 + width * k
        parts.append(f'<rect x="{x:.3f}" y="40" width="{width + .05:.3f}" height="100" fill="rgb({code},{code},{code})"/>')
        parts.append(f'<text x="{x + width / 2:.2f}" y="147" font-size="4" text-anchor="middle">{code}</text>')
    parts.append('<rect x="18.5" y="40" width="260.05" height="100" fill="none" stroke="#000" stroke-width=".2"/>')
    page("grey-wedge-a4.svg", 297, 210, "Grey wedge: sRGB codes 0 to 255 in 12 steps.", parts)


def star(spokes=36, radius=85):
    """A Siemens star: where its spokes melt into grey, at r mm, lens or projector resolve no more than 2 pi r / spokes
    mm a pair of lines."""
    paths = ""
    for k in range(spokes):
        a, b = (2 * math.pi * (k + d) / spokes for d in (0, 0.5))
        paths += (f"M148.5 92L{148.5 + radius * math.cos(a):.3f} {92 + radius * math.sin(a):.3f}"
                  f"A{radius} {radius} 0 0 1 {148.5 + radius * math.cos(b):.3f} {92 + radius * math.sin(b):.3f}z")
    rings = "".join(f'<circle cx="148.5" cy="92" r="{r}" fill="none" stroke="#d00" stroke-width=".3"/>'
                    for r in (10, 20, 40))
    page("focus-star-a4.svg", 297, 210, f"Focus star: {spokes} spokes, rings at 10, 20 and 40 mm.",
         [f'<path d="{paths}" fill="#000"/>', rings])


chessboard()
wedge()
star()
