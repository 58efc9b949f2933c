#!/usr/bin/env python3
"""Makes musikverein.obj: the great hall of the Musikverein in Vienna, as a model for room acoustics has it.

The model is by Nathaniel Fletcher and Brian Hamilton, derived with permission from that of the Odeon software, under
CC BY-SA 4.0 (https://creativecommons.org/licenses/by-sa/4.0/). It is not part of this project: this script fetches it
from https://github.com/bsxfun/pffdtd and writes its triangles as an OBJ file in metres, with z upwards and one material
for each of its five surfaces. The file, and pictures of it, are under the same licence.

    python3 musikverein.py [model_export.json]

writes musikverein.obj and musikverein.mtl into the folder in which it runs. With a file, nothing is fetched.
"""

import json
import sys
import urllib.request

SOURCE = (
    "https://raw.githubusercontent.com/bsxfun/pffdtd/aa319f6c86517cb95aabfae8656277da62c3ead5/"
    "data/models/Musikverein_ConcertHall/model_export.json"
)


def linear(byte):
    """A byte of the sRGB space as a linear value."""
    value = byte / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def main():
    if len(sys.argv) > 1:
        with open(sys.argv[1], "rb") as file:
            model = json.load(file)
    else:
        with urllib.request.urlopen(SOURCE) as answer:
            model = json.load(answer)
    surfaces = model["mats_hash"]
    with open("musikverein.mtl", "w", encoding="ascii") as file:
        for name, surface in surfaces.items():
            colour = " ".join(f"{linear(byte):.4f}" for byte in surface["color"])
            file.write(f"newmtl {name}\nKd {colour}\n")
    with open("musikverein.obj", "w", encoding="ascii") as file:
        file.write("mtllib musikverein.mtl\n")
        first = 1
        for name, surface in surfaces.items():
            file.write(f"o {name}\nusemtl {name}\n")
            for point in surface["pts"]:
                file.write("v " + " ".join(f"{coordinate:.6f}" for coordinate in point) + "\n")
            for corners in surface["tris"]:
                file.write("f " + " ".join(str(first + corner) for corner in corners) + "\n")
            first += len(surface["pts"])


if __name__ == "__main__":
    main()
