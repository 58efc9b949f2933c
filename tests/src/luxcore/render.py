"""Renders an exported scene with LuxCore for a number of core seconds on one thread. Writes the picture as 32-bit
floats: red, green and blue, row by row from the top left.

    python render.py FOLDER OUTPUT ENGINE SEED CORE_SECONDS

HYBRID is PATHCPU with light tracing for caustics.

Scenes may have matt surfaces, panes, suns, spheres and a sky of one colour.
"""

import json
import math
import os
import sys
import time

import numpy
import pyluxcore
from PIL import Image

folder, output, engine, seed, core_seconds = sys.argv[1:6]
with open(os.path.join(folder, 'scene.json'), encoding='utf-8') as file:
    exported = json.load(file)

# Rows and columns of the triangles of a sphere.
ROWS, COLUMNS = 32, 64


def properties(members):
    made = pyluxcore.Properties()
    for name, value in members.items():
        made.Set(pyluxcore.Property(name, value))
    return made


def sphere(centre, radius):
    """Places and triangles."""
    places = []
    for row in range(ROWS + 1):
        polar = math.pi * row / ROWS
        for column in range(COLUMNS):
            around = 2 * math.pi * column / COLUMNS
            normal = (math.sin(polar) * math.cos(around), math.sin(polar) * math.sin(around), math.cos(polar))
            places.append(tuple(c + radius * n for c, n in zip(centre, normal)))
    at = lambda row, column: row * COLUMNS + column % COLUMNS
    triangles = []
    for row in range(ROWS):
        for column in range(COLUMNS):
            a, b, c, d = at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)
            triangles += [(a, b, d)] if row > 0 else []
            triangles += [(b, c, d)] if row < ROWS - 1 else []
    return places, triangles


def with_coordinates(name):
    """The file of a mesh with texture coordinates as LuxCore calls them."""
    with open(os.path.join(folder, name), 'rb') as file:
        data = file.read()
    end = data.index(b'end_header')
    header = data[:end].replace(b'float u\n', b'float s\n').replace(b'float v\n', b'float t\n')
    path = os.path.join(folder, 'luxcore-' + os.path.basename(name))
    with open(path, 'wb') as file:
        file.write(header + data[end:])
    return path


def linear_picture(name):
    """The file of a picture with linear values, since LuxCore knows no transfer function of sRGB."""
    pixels = numpy.asarray(Image.open(os.path.join(folder, name)).convert('RGB')) / 255.0
    linear = numpy.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
    path = os.path.join(folder, 'luxcore-' + os.path.basename(name) + '.pfm')
    with open(path, 'wb') as file:
        file.write(f'PF\n{linear.shape[1]} {linear.shape[0]}\n-1.0\n'.encode() + linear[::-1].astype('<f4').tobytes())
    return path


pyluxcore.Init()
pyluxcore.SetLogHandler(lambda _: None)
scene = pyluxcore.Scene()


def colour(name, value):
    """What a property takes for a colour or a texture."""
    if 'colour' in value:
        return list(value['colour'])
    texture = value['texture']
    if texture['transform'] != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]:
        sys.exit(f"the texture of {name} is moved")
    place = f'scene.textures.{name}'
    scene.Parse(properties({
        f'{place}.type': 'imagemap', f'{place}.file': linear_picture(texture['file']), f'{place}.gamma': 1.0,
        f'{place}.mapping.type': 'uvmapping2d', f'{place}.mapping.uvscale': [1.0, -1.0],
        f'{place}.mapping.uvdelta': [0.0, 1.0]}))
    return name


def add(name, material, mesh=None):
    if mesh:
        scene.Parse(properties({
            f'scene.shapes.{name}.type': 'mesh', f'scene.shapes.{name}.ply': with_coordinates(mesh)}))
    scene.Parse(properties({f'scene.objects.{name}.shape': name, f'scene.objects.{name}.material': material}))


film, camera = exported['film'], exported['camera']
half = math.radians(camera['perspective']['vertical_field_of_view'] / 2)
scene.Parse(properties({
    'scene.camera.type': 'perspective', 'scene.camera.lookat.orig': camera['position'],
    'scene.camera.lookat.target': camera['look_at'], 'scene.camera.up': camera['up'],
    'scene.camera.fieldofview': 2 * math.degrees(math.atan(math.tan(half) * max(1, film['width'] / film['height']))),
    'scene.camera.autofocus.enable': 0, 'scene.camera.lensradius': 0.0, 'scene.camera.cliphither': 1e-3,
    'scene.epsilon.min': 1e-5, 'scene.epsilon.max': 1e-5}))
materials = {}
for number, material in enumerate(exported['materials']):
    materials[material['name']] = name = f'material{number}'
    scene.Parse(properties({
        f'scene.materials.{name}.type': 'matte',
        f'scene.materials.{name}.kd': colour(name, material['diffuse']['reflectance'])}))
scene.Parse(properties({'scene.materials.black.type': 'matte', 'scene.materials.black.kd': [0.0] * 3}))
for number, mesh in enumerate(exported['meshes']):
    add(f'mesh{number}', materials[mesh['material']], mesh['file'])
for number, pane in enumerate(exported['panes']):
    volume, glass = f'scene.volumes.volume{number}', f'scene.materials.glass{number}'
    scene.Parse(properties({
        f'{volume}.type': 'clear', f'{volume}.absorption': pane['absorption'],
        f'{volume}.ior': pane['index_of_refraction']}))
    scene.Parse(properties({
        f'{glass}.type': 'glass', f'{glass}.kr': [1.0] * 3, f'{glass}.kt': [1.0] * 3,
        f'{glass}.interiorior': pane['index_of_refraction'], f'{glass}.exteriorior': 1.0,
        f'{glass}.volume.interior': f'volume{number}'}))
    add(f'pane{number}', f'glass{number}', pane['faces'])
    add(f'edge{number}', 'black', pane['edge'])
for number, light in enumerate(exported['lights']):
    place = f'scene.lights.light{number}'
    if 'sphere' in light:
        emitter = f'scene.materials.lamp{number}'
        scene.Parse(properties({
            f'{emitter}.type': 'matte', f'{emitter}.kd': [0.0] * 3, f'{emitter}.emission': light['sphere']['radiance'],
            f'{emitter}.emission.normalizebycolor': 0}))
        places, triangles = sphere(light['sphere']['centre'], light['sphere']['radius'])
        scene.DefineMesh(f'lamp{number}', places, triangles, None, None, None, None)
        add(f'lamp{number}', f'lamp{number}')
    elif 'distant' in light:
        scene.Parse(properties({
            f'{place}.type': 'distant', f'{place}.direction': [-x for x in light['distant']['direction']],
            f'{place}.color': light['distant']['radiance'], f'{place}.gain': [1.0] * 3,
            f'{place}.theta': light['distant']['angular_radius'], f'{place}.normalizebycolor': 0}))
    elif 'colour' in light.get('environment', {}).get('radiance', {}):
        scene.Parse(properties({
            f'{place}.type': 'constantinfinite', f'{place}.color': light['environment']['radiance']['colour'],
            f'{place}.gain': [1.0] * 3}))
    else:
        sys.exit(f"found the light {light['name']}, expected a sun, a sphere or a sky of one colour")

depth = exported['max_depth']
is_hybrid = engine == 'HYBRID'
config = pyluxcore.RenderConfig(properties({
    'renderengine.type': 'PATHCPU' if is_hybrid else engine, 'path.hybridbackforward.enable': int(is_hybrid),
    'renderengine.seed': int(seed), 'sampler.type': 'METROPOLIS',
    'native.threads.count': 1, 'film.width': film['width'], 'film.height': film['height'],
    'film.filter.type': 'NONE', 'film.imagepipelines.0.0.type': 'NOP', 'film.outputs.0.type': 'RGB',
    'film.outputs.0.filename': 'unused.exr', 'path.clamping.variance.maxvalue': 0.0,
    'path.pathdepth.total': depth, 'path.pathdepth.diffuse': depth, 'path.pathdepth.glossy': depth,
    'path.pathdepth.specular': depth, 'path.maxdepth': depth, 'light.maxdepth': depth}), scene)
session = pyluxcore.RenderSession(config)
session.Start()
began = time.process_time()
while time.process_time() - began < float(core_seconds):
    time.sleep(0.02)
session.Stop()
picture = numpy.zeros((film['height'], film['width'], 3), dtype='f4')
session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, picture, 0)
picture[::-1].astype('<f4').tofile(output)
sys.stdout.flush()
# It does not end well otherwise.
os._exit(0)
