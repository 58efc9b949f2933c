"""Renders a scene with several seeds, and writes the pictures one after another as 32-bit floats, red, green, blue.

    python render.py SCENE.xml OUTPUT SAMPLES FIRST_SEED SEEDS
"""

import sys

import mitsuba
import numpy

scene_file, output, samples, first, seeds = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6])
mitsuba.set_variant('scalar_rgb')
scene = mitsuba.load_file(scene_file, spp=str(samples))
with open(output, 'wb') as file:
    for seed in range(first, first + seeds):
        picture = numpy.array(mitsuba.render(scene, spp=samples, seed=seed), dtype='<f4')
        if picture.ndim != 3 or picture.shape[2] != 3:
            sys.exit(f'expected red, green and blue, found an array of shape {picture.shape}')
        file.write(picture.tobytes())
