"""Builds the chapel in Blender and writes it as a GLB file.

python chapel.py [chapel.glb], with the package bpy of PyPI, or
blender --background --python chapel.py [-- chapel.glb]

A hall of 6 x 10 x 5 m with textured walls. The windows of the west wall are flat quads, those of the east wall thin
boxes. The rose says in its custom property `clerestory` what glass it is. A sun, a lamp that glows, and a camera.
"""

import random
import sys

import bpy

WIDTH, LENGTH, HEIGHT, WALL = 6.0, 10.0, 5.0, 0.35
LEAD = 0.012


def picture(name, size, colour_at):
    """A packed picture whose colours are those of a function of column and row."""
    image = bpy.data.images.new(name, size, size)
    image.pixels = [value for y in range(size) for x in range(size) for value in (*colour_at(x, y), 1.0)]
    image.pack()
    return image


def stone(size=192, courses=6):
    """Courses of stone in mortar."""
    numbers = random.Random(1)
    tones = [[numbers.uniform(0.82, 1.0) for _ in range(3)] for _ in range(courses)]
    course = size // courses

    def colour(x, y):
        row = y // course
        block = (x + (row % 2) * size // 6) % size
        is_mortar = y % course < 2 or block % (size // 3) < 2
        tone = 0.6 if is_mortar else tones[row][block // (size // 3)] * numbers.choice((0.97, 1.0))
        return 0.72 * tone, 0.66 * tone, 0.57 * tone

    return picture("stone", size, colour)


def tiles(size=64):
    """Two dark and two light tiles."""

    def colour(x, y):
        is_dark = (x < size // 2) == (y < size // 2)
        is_joint = x % (size // 2) == 0 or y % (size // 2) == 0
        return (0.3,) * 3 if is_joint else (0.42, 0.2, 0.14) if is_dark else (0.68, 0.62, 0.5)

    return picture("tiles", size, colour)


def material(name, colour=(0.8, 0.8, 0.8), image=None, **inputs):
    """A Principled material. Other inputs of the node have their names with spaces as underscores."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    principled = nodes["Principled BSDF"]
    principled.inputs["Base Color"].default_value = (*colour, 1.0)
    for name_of_input, value in {"Roughness": 0.9, **inputs}.items():
        principled.inputs[name_of_input.replace("_", " ")].default_value = value
    if image:
        node = nodes.new("ShaderNodeTexImage")
        node.image = image
        links.new(node.outputs["Color"], principled.inputs["Base Color"])
    return made


def thing(name, made_of, quads, metres_per_picture=1.0, is_smooth=False):
    """An object of quads, each four corners counterclockwise from outside. A picture repeats in equal lengths."""
    mesh = bpy.data.meshes.new(name)
    corners = [corner for quad in quads for corner in quad]
    mesh.from_pydata(corners, [], [range(4 * index, 4 * index + 4) for index in range(len(quads))])
    layer = mesh.uv_layers.new()
    for polygon in mesh.polygons:
        normal = [abs(part) for part in polygon.normal]
        along = [axis for axis in range(3) if axis != normal.index(max(normal))]
        for loop in polygon.loop_indices:
            at = mesh.vertices[mesh.loops[loop].vertex_index].co
            layer.data[loop].uv = [at[axis] / metres_per_picture for axis in along]
        polygon.use_smooth = is_smooth
    mesh.materials.append(made_of)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(made)
    return made


def box(low, high):
    """The six quads of a box."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return [
        [(x0, y0, z0), (x0, y1, z0), (x1, y1, z0), (x1, y0, z0)],
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
        [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
    ]


def wall(axis, low, high, length, openings):
    """A wall from `low` to `high` across `axis`, around openings (from, to, sill, head) along the other axis."""
    cuts = sorted({-WALL, length + WALL, *(edge for opening in openings for edge in opening[:2])})
    levels = sorted({0.0, HEIGHT, *(edge for opening in openings for edge in opening[2:])})
    quads = []
    for start, end in zip(cuts, cuts[1:]):
        for bottom, top in zip(levels, levels[1:]):
            middle, height = 0.5 * (start + end), 0.5 * (bottom + top)
            if any(a < middle < b and sill < height < head for a, b, sill, head in openings):
                continue
            if axis == 0:
                quads += box((low, start, bottom), (high, end, top))
            else:
                quads += box((start, low, bottom), (end, high, top))
    return quads


def lights(opening, columns, rows):
    """The lights of a window: rectangles (from, to, bottom, top) with lead between them."""
    start, end, sill, head = opening
    wide, high = (end - start) / columns, (head - sill) / rows
    for row in range(rows):
        for column in range(columns):
            a, b = start + column * wide, sill + row * high
            yield a + LEAD / 2, a + wide - LEAD / 2, b + LEAD / 2, b + high - LEAD / 2


def leads(axis, at, opening, columns, rows):
    """The lead of a window in a wall across an axis: bars between the lights, with flanges over the edges."""
    start, end, sill, head = opening
    uprights = [start + column * (end - start) / columns for column in range(columns + 1)]
    levels = [sill + row * (head - sill) / rows for row in range(rows + 1)]
    quads = []
    for near, far, half in ((-0.003, 0.003, LEAD / 2), (-0.006, -0.003, LEAD), (0.003, 0.006, LEAD)):
        bars = [(along - half, along + half, sill, head) for along in uprights]
        bars += [(start, end, height - half, height + half) for height in levels]
        for a, b, bottom, top in bars:
            low, high = [a, bottom], [b, top]
            low.insert(axis, at + near)
            high.insert(axis, at + far)
            quads += box(low, high)
    return quads


def build():
    """Builds the scene in an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.unit_settings.system = "METRIC"
    walls = material("Stone", image=stone())
    floor = material("Tiles", image=tiles(), Roughness=0.5)
    wood = material("Oak", (0.2, 0.11, 0.05), Roughness=0.7)
    lead = material("Lead", (0.1, 0.1, 0.11), Roughness=0.6, Metallic=1.0)
    glass = material("Glass", (1.0, 1.0, 1.0), Roughness=0.0, IOR=1.52, Transmission_Weight=1.0)
    glow = material("Flame", (0.0, 0.0, 0.0), Emission_Color=(1.0, 0.75, 0.45, 1.0), Emission_Strength=6.0)

    west = [(1.0 + 3.0 * index, 2.0 + 3.0 * index, 1.6, 4.0) for index in range(3)]
    east = [(2.4 + 3.4 * index, 3.4 + 3.4 * index, 1.6, 4.0) for index in range(2)]
    rose = (2.4, 3.6, 2.8, 4.0)
    thing("Wall west", walls, wall(0, -WALL, 0.0, LENGTH, west), 2.0)
    thing("Wall east", walls, wall(0, WIDTH, WIDTH + WALL, LENGTH, east), 2.0)
    thing("Wall south", walls, wall(1, -WALL, 0.0, WIDTH, []), 2.0)
    thing("Wall north", walls, wall(1, LENGTH, LENGTH + WALL, WIDTH, [rose]), 2.0)
    thing("Floor", floor, box((-WALL, -WALL, -0.3), (WIDTH + WALL, LENGTH + WALL, 0.0)), 1.0)
    thing("Ceiling", wood, box((-WALL, -WALL, HEIGHT), (WIDTH + WALL, LENGTH + WALL, HEIGHT + 0.3)))
    beams = [box((0.0, y - 0.1, HEIGHT - 0.3), (WIDTH, y + 0.1, HEIGHT)) for y in (1.5, 3.5, 5.5, 7.5)]
    thing("Beams", wood, sum(beams, []))

    x = -0.5 * WALL
    for number, opening in enumerate(west, 1):
        flat = [[(x, a, b), (x, c, b), (x, c, d), (x, a, d)] for a, c, b, d in lights(opening, 2, 4)]
        thing(f"Window west {number}", glass, flat)
        thing(f"Leads west {number}", lead, leads(0, x, opening, 2, 4))
    x = WIDTH + 0.5 * WALL
    for number, opening in enumerate(east, 1):
        thin = [box((x - 0.002, a, b), (x + 0.002, c, d)) for a, c, b, d in lights(opening, 1, 2)]
        thing(f"Window east {number}", glass, sum(thin, []))
        thing(f"Leads east {number}", lead, leads(0, x, opening, 1, 2))
    y = LENGTH + 0.5 * WALL
    thing("Leads rose", lead, leads(1, y, rose, 2, 2))
    quads = [[(a, y, b), (c, y, b), (c, y, d), (a, y, d)] for a, c, b, d in lights(rose, 2, 2)]
    tagged = thing("Rose", glass, quads)
    tagged["clerestory"] = {"kind": "pane", "profile": "hammered", "thickness": 0.003}

    benches = []
    for row in range(5):
        for start in (0.6, 3.6):
            y = 1.4 + 1.1 * row
            benches += box((start, y, 0.42), (start + 1.8, y + 0.35, 0.47))
            benches += box((start, y - 0.05, 0.0), (start + 1.8, y, 0.9))
    thing("Benches", wood, benches)
    thing("Altar", walls, box((2.2, 8.3, 0.0), (3.8, 9.1, 1.0)), 1.0)

    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=0.12, location=(3.0, 8.0, 2.6))
    lamp = bpy.context.object
    lamp.name = lamp.data.name = "Lamp"
    lamp.data.materials.append(glow)
    bpy.ops.object.shade_smooth()
    thing("Chain", lead, box((2.995, 7.995, 2.72), (3.005, 8.005, HEIGHT)))

    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy = 80.0
    sun.data.color = (1.0, 0.93, 0.82)
    # It shines through the west windows onto floor and benches.
    sun.rotation_euler = (0.25, -0.95, 0.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle = 1.1
    camera.location = (4.4, 0.5, 1.7)
    camera.rotation_euler = (1.53, 0.0, 0.22)
    for made in (sun, camera):
        bpy.context.collection.objects.link(made)
    bpy.context.scene.camera = camera


def main():
    """Builds the scene and writes the file."""
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    build()
    bpy.ops.export_scene.gltf(
        filepath=words[0] if words else "chapel.glb",
        export_format="GLB",
        export_extras=True,
        export_lights=True,
        export_cameras=True,
        export_apply=True,
    )


if __name__ == "__main__":
    main()
