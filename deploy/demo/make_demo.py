#!/usr/bin/env python3
"""Writes the demo scene and sky: courtyard.glb and sky.hdr, beside this file.

A walled courtyard, 12 m by 9 m, open to the sky: tiled floor, an arcade of round arches on
columns along the north wall, steps, crates, and a lamp over a warm emissive panel under the
arcade. Everything is computed; running the script again gives the same bytes.

Conventions: glTF's (right-handed, +Y up, metres, counter-clockwise front faces). North is -Z.
"""

import json
import math
import pathlib
import struct
import zlib

HERE = pathlib.Path(__file__).resolve().parent

# ---------------------------------------------------------------------------------------- geometry


class Mesh:
    """Vertices with a normal and a texture coordinate, in metres, and counter-clockwise triangles."""

    def __init__(self):
        self.positions, self.normals, self.uvs, self.triangles = [], [], [], []

    def vertex(self, position, normal, uv):
        self.positions.append(position)
        self.normals.append(normal)
        self.uvs.append(uv)
        return len(self.positions) - 1

    def grid(self, columns, rows, at):
        """A grid of quads; at(u, v) with u, v in [0, 1] gives (position, normal, uv), and
        d(position)/du x d(position)/dv points along the normal."""
        first = len(self.positions)
        for j in range(rows + 1):
            for i in range(columns + 1):
                self.vertex(*at(i / columns, j / rows))
        for j in range(rows):
            for i in range(columns):
                a = first + j * (columns + 1) + i
                b, c, d = a + 1, a + columns + 2, a + columns + 1
                self.triangles += [(a, b, c), (a, c, d)]

    def rectangle(self, corner, u_edge, v_edge, cell, uv_scale=0.5):
        """A flat rectangle in cells of about `cell` metres; its front faces u_edge x v_edge."""
        normal = unit(cross(u_edge, v_edge))
        width, height = length(u_edge), length(v_edge)

        def at(u, v):
            position = tuple(corner[k] + u * u_edge[k] + v * v_edge[k] for k in range(3))
            return position, normal, (u * width * uv_scale, v * height * uv_scale)

        self.grid(max(1, round(width / cell)), max(1, round(height / cell)), at)

    def box(self, low, high, cell, turn_degrees=0.0, bottom=False):
        """A box, turned about the vertical through its centre; its underside only when asked."""
        x0, y0, z0 = low
        x1, y1, z1 = high
        first = len(self.positions)
        dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
        self.rectangle((x0, y0, z1), (dx, 0, 0), (0, dy, 0), cell)
        self.rectangle((x1, y0, z0), (-dx, 0, 0), (0, dy, 0), cell)
        self.rectangle((x1, y0, z1), (0, 0, -dz), (0, dy, 0), cell)
        self.rectangle((x0, y0, z0), (0, 0, dz), (0, dy, 0), cell)
        self.rectangle((x0, y1, z1), (dx, 0, 0), (0, 0, -dz), cell)
        if bottom:
            self.rectangle((x0, y0, z0), (dx, 0, 0), (0, 0, dz), cell)
        cosine, sine = math.cos(math.radians(turn_degrees)), math.sin(math.radians(turn_degrees))
        cx, cz = (x0 + x1) / 2, (z0 + z1) / 2

        def turned(x, z):
            return cosine * x + sine * z, cosine * z - sine * x

        for i in range(first, len(self.positions)):
            x, y, z = self.positions[i]
            tx, tz = turned(x - cx, z - cz)
            self.positions[i] = (cx + tx, y, cz + tz)
            nx, ny, nz = self.normals[i]
            mx, mz = turned(nx, nz)
            self.normals[i] = (mx, ny, mz)


def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(a):
    return math.sqrt(sum(x * x for x in a))


def unit(a):
    size = length(a)
    return tuple(x / size for x in a)


def column(mesh, x, z, height):
    """A round column on a square foot and under a square capital."""
    mesh.box((x - 0.28, 0, z - 0.28), (x + 0.28, 0.2, z + 0.28), 0.2)
    mesh.box((x - 0.28, height - 0.2, z - 0.28), (x + 0.28, height, z + 0.28), 0.2, bottom=True)
    foot, top = 0.2, height - 0.2

    def at(u, v):
        angle = 2 * math.pi * u
        y = foot + v * (top - foot)
        # A slight belly: radius 0.20 m at the ends, 0.23 m a third of the way up.
        t = y / height
        radius = 0.20 + 0.03 * max(0.0, 1 - ((t - 0.33) / 0.67) ** 2)
        # u runs anti-clockwise seen from above, so that d/du x d/dv points outwards.
        normal = (math.cos(angle), 0.0, -math.sin(angle))
        return (x + radius * normal[0], y, z + radius * normal[2]), normal, (2 * u, v * 1.2)

    mesh.grid(20, 12, at)


def arch(mesh, x0, x1, spring, top, z_front, z_back):
    """The wall above a round opening between two columns: front, back and the curved underside."""
    centre, radius = (x0 + x1) / 2, (x1 - x0) / 2
    steps = 20

    def rim(u):
        angle = math.pi * (1 - u)
        return centre + radius * math.cos(angle), spring + radius * math.sin(angle)

    def face(z, front):
        def at(u, v):
            x, y = rim(u if front else 1 - u)
            y += v * (top - y)
            return (x, y, z), (0.0, 0.0, 1.0 if front else -1.0), (x / 2, y / 2)

        return at

    mesh.grid(steps, 5, face(z_front, True))
    mesh.grid(steps, 5, face(z_back, False))

    def underside(u, v):
        x, y = rim(u)
        z = z_back + v * (z_front - z_back)
        normal = ((centre - x) / radius, (spring - y) / radius, 0.0)
        return (x, y, z), normal, (u * 1.5, v * 0.5)

    mesh.grid(steps, 3, underside)


def courtyard():
    """Meshes by material name."""
    floor, walls, stone, wood, lamp = Mesh(), Mesh(), Mesh(), Mesh(), Mesh()
    x0, x1, z0, z1, height = -6.0, 6.0, -4.5, 4.5, 3.6

    floor.rectangle((x0, 0, z1), (x1 - x0, 0, 0), (0, 0, z0 - z1), 0.25)

    # Walls with an inner face, a coping on top and an outer face.
    thick = 0.3
    walls.rectangle((x0, 0, z0), (x1 - x0, 0, 0), (0, height, 0), 0.3)
    walls.rectangle((x1, 0, z1), (x0 - x1, 0, 0), (0, height, 0), 0.3)
    walls.rectangle((x0, 0, z1), (0, 0, z0 - z1), (0, height, 0), 0.3)
    walls.rectangle((x1, 0, z0), (0, 0, z1 - z0), (0, height, 0), 0.3)
    xo0, xo1, zo0, zo1 = x0 - thick, x1 + thick, z0 - thick, z1 + thick
    walls.rectangle((xo1, 0, zo0), (xo0 - xo1, 0, 0), (0, height, 0), 0.6)
    walls.rectangle((xo0, 0, zo1), (xo1 - xo0, 0, 0), (0, height, 0), 0.6)
    walls.rectangle((xo0, 0, zo0), (0, 0, zo1 - zo0), (0, height, 0), 0.6)
    walls.rectangle((xo1, 0, zo1), (0, 0, zo0 - zo1), (0, height, 0), 0.6)
    stone.rectangle((xo0, height, z0), (xo1 - xo0, 0, 0), (0, 0, -thick), 0.3)
    stone.rectangle((xo0, height, zo1), (xo1 - xo0, 0, 0), (0, 0, -thick), 0.3)
    stone.rectangle((xo0, height, z1), (thick, 0, 0), (0, 0, z0 - z1), 0.3)
    stone.rectangle((x1, height, z1), (thick, 0, 0), (0, 0, z0 - z1), 0.3)

    gap = 0.005  # between what leans on a wall and the wall, so that no two faces coincide

    # The arcade: five arches on four columns and two half piers, with a roof.
    bays, spring, top = 5, 2.0, 3.3
    pitch = (x1 - x0) / bays
    z_front, z_back = -2.0, -2.45
    middle = (z_front + z_back) / 2
    for i in range(bays):
        left, right = x0 + i * pitch, x0 + (i + 1) * pitch
        arch(stone, left + 0.2, right - 0.2, spring, top, z_front, z_back)
        if i:
            column(stone, left, middle, spring)
            # The strip of wall above the column, between two arches.
            stone.rectangle((left - 0.2, spring, z_front), (0.4, 0, 0), (0, top - spring, 0), 0.2)
            stone.rectangle((left + 0.2, spring, z_back), (-0.4, 0, 0), (0, top - spring, 0), 0.2)
    for x in (x0 + gap, x1 - 0.2):
        stone.box((x, 0, z_back), (x + 0.2 - gap, top, z_front), 0.25)
    stone.rectangle((x0, top, z_front), (x1 - x0, 0, 0), (0, 0, z0 - z_front), 0.3)
    stone.rectangle((x0, top - 0.12, z0), (x1 - x0, 0, 0), (0, 0, z_front - z0), 0.3)

    # Three steps along the east wall, a plinth, and crates.
    for i in range(3):
        stone.box((x1 - 1.5 + 0.4 * i, 0.22 * i, 0.2), (x1 - gap, 0.22 * (i + 1), 3.4), 0.25)
    stone.box((-0.6, 0, 0.6), (0.6, 0.35, 1.8), 0.15, turn_degrees=45)
    stone.box((-0.3, 0.35, 0.9), (0.3, 1.25, 1.5), 0.15, turn_degrees=45)
    wood.box((-5.2, 0, 2.6), (-4.2, 1.0, 3.6), 0.125, turn_degrees=12)
    wood.box((-4.0, 0, 3.1), (-3.3, 0.7, 3.8), 0.125, turn_degrees=-20)
    wood.box((-5.0, 1.0, 2.8), (-4.4, 1.6, 3.4), 0.125, turn_degrees=33)

    # A warm panel on the north wall, under the arcade.
    lamp.box((-0.8, 1.4, z0 + gap), (0.8, 2.0, z0 + 0.06), 0.2, bottom=True)
    return {"floor": floor, "walls": walls, "stone": stone, "wood": wood, "lamp": lamp}


# ----------------------------------------------------------------------------------------- texture


def noise(x, y):
    """A fixed hash of two integers in [0, 1)."""
    value = (x * 374761393 + y * 668265263) & 0xFFFFFFFF
    value = ((value ^ (value >> 13)) * 1274126177) & 0xFFFFFFFF
    return ((value ^ (value >> 16)) & 0xFFFF) / 65536


def png(width, height, pixel):
    """An 8-bit RGB picture; pixel(x, y) gives three integers."""
    rows = b"".join(
        b"\0" + bytes(c for x in range(width) for c in pixel(x, y)) for y in range(height)
    )

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows, 9))
        + chunk(b"IEND", b"")
    )


def tiles():
    """Four by four terracotta tiles with grey joints; repeats without a seam."""
    size, tile, joint = 128, 32, 2

    def pixel(x, y):
        i, j = x // tile, y // tile
        if x % tile < joint or y % tile < joint:
            shade = 118 + int(20 * noise(x, y))
            return shade, shade - 4, shade - 10
        base = 0.82 + 0.30 * noise(i + 100, j + 7) + 0.08 * (noise(x, y) - 0.5)
        return tuple(min(255, int(base * c)) for c in (186, 122, 92))

    return png(size, size, pixel)


# --------------------------------------------------------------------------------------------- GLB

MATERIALS = [
    ("floor", {"baseColorTexture": {"index": 0}}),
    ("walls", {"baseColorFactor": [0.76, 0.70, 0.60, 1.0]}),
    ("stone", {"baseColorFactor": [0.62, 0.60, 0.57, 1.0]}),
    ("wood", {"baseColorFactor": [0.36, 0.22, 0.11, 1.0]}),
    ("lamp", {"baseColorFactor": [0.05, 0.05, 0.05, 1.0]}),
]


def glb():
    meshes = courtyard()
    binary = bytearray()
    views, accessors = [], []

    def view(data, target=None):
        while len(binary) % 4:
            binary.append(0)
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        if target:
            views[-1]["target"] = target
        binary.extend(data)
        return len(views) - 1

    def floats(rows, kind, bounds=False):
        width = len(rows[0])
        data = struct.pack(f"<{len(rows) * width}f", *(x for row in rows for x in row))
        accessor = {"bufferView": view(data, 34962), "componentType": 5126, "count": len(rows)}
        accessor["type"] = kind
        if bounds:
            stored = struct.unpack(f"<{len(rows) * width}f", data)
            accessor["min"] = [min(stored[k::width]) for k in range(width)]
            accessor["max"] = [max(stored[k::width]) for k in range(width)]
        accessors.append(accessor)
        return len(accessors) - 1

    def indices(triangles):
        flat = [i for triangle in triangles for i in triangle]
        data = struct.pack(f"<{len(flat)}H", *flat)
        accessors.append(
            {
                "bufferView": view(data, 34963),
                "componentType": 5123,
                "count": len(flat),
                "type": "SCALAR",
            }
        )
        return len(accessors) - 1

    gltf_meshes, nodes, materials = [], [], []
    for index, (name, metal_rough) in enumerate(MATERIALS):
        mesh = meshes[name]
        assert len(mesh.positions) < 65536
        primitive = {
            "attributes": {
                "POSITION": floats(mesh.positions, "VEC3", bounds=True),
                "NORMAL": floats(mesh.normals, "VEC3"),
                "TEXCOORD_0": floats(mesh.uvs, "VEC2"),
            },
            "indices": indices(mesh.triangles),
            "material": index,
        }
        gltf_meshes.append({"name": name, "primitives": [primitive]})
        nodes.append({"name": name, "mesh": index})
        material = {
            "name": name,
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0, **metal_rough},
        }
        if name == "lamp":
            material["emissiveFactor"] = [1.0, 0.62, 0.28]
            material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 12.0}}
        materials.append(material)
    nodes.append(
        {
            "name": "lantern",
            "translation": [-4.9, 2.6, -3.3],
            "extensions": {"KHR_lights_punctual": {"light": 0}},
        }
    )
    image = view(tiles())
    document = {
        "asset": {"version": "2.0", "generator": "Lightkiln deploy/demo/make_demo.py"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensions": {
            "KHR_lights_punctual": {
                "lights": [
                    {
                        "name": "lantern",
                        "type": "point",
                        "color": [1.0, 0.75, 0.45],
                        "intensity": 12.0,
                    }
                ]
            }
        },
        "scene": 0,
        "scenes": [{"name": "courtyard", "nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": gltf_meshes,
        "materials": materials,
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}],
        "images": [{"name": "tiles", "bufferView": image, "mimeType": "image/png"}],
        "accessors": accessors,
        "bufferViews": views,
    }
    while len(binary) % 4:
        binary.append(0)
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + bytes(binary)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


# --------------------------------------------------------------------------------------------- sky

SKY_WIDTH, SKY_HEIGHT = 512, 256
SUN = unit((0.55, 0.80, 0.45))  # towards the sun: from the south-east, about 49 degrees high
SUN_RADIUS = math.radians(1.5)  # larger than the real one, so that several pixels hold it
SUN_RADIANCE = (3600.0, 3250.0, 2700.0)


def sky_radiance(direction):
    """Blue above, paler towards the horizon, a glow about the sun, and brown ground below."""
    up = direction[1]
    cosine = sum(a * b for a, b in zip(direction, SUN))
    if up < 0:
        fade = math.exp(12 * up)
        return tuple(
            ground * (1 - fade) + haze * fade
            for ground, haze in zip((0.16, 0.13, 0.10), (0.75, 0.80, 0.86))
        )
    share = (1 - up) ** 3
    glow = 0.9 * max(0.0, cosine) ** 32 + 0.25 * max(0.0, cosine) ** 4
    return tuple(
        zenith * (1 - share) + horizon * share + glow * tint
        for zenith, horizon, tint in zip((0.16, 0.34, 0.78), (0.85, 0.92, 1.0), (1.0, 0.88, 0.66))
    )


def sky_direction(x, y):
    """The direction of image point (x, y) in pixels: the centre looks at +Z, +X lies to its left,
    the top row is +Y."""
    longitude = math.pi - 2 * math.pi * x / SKY_WIDTH
    latitude = math.pi / 2 - math.pi * y / SKY_HEIGHT
    return (
        math.cos(latitude) * math.sin(longitude),
        math.sin(latitude),
        math.cos(latitude) * math.cos(longitude),
    )


def sky_pixel(x, y):
    """The mean over 4 x 4 points for the sun's disk, and the centre for the rest."""
    radiance = sky_radiance(sky_direction(x + 0.5, y + 0.5))
    centre = sky_direction(x + 0.5, y + 0.5)
    if sum(a * b for a, b in zip(centre, SUN)) < math.cos(2 * SUN_RADIUS):
        return radiance
    inside = 0
    for j in range(4):
        for i in range(4):
            d = sky_direction(x + (i + 0.5) / 4, y + (j + 0.5) / 4)
            inside += sum(a * b for a, b in zip(d, SUN)) >= math.cos(SUN_RADIUS)
    return tuple(c + sun * inside / 16 for c, sun in zip(radiance, SUN_RADIANCE))


def rgbe(rgb):
    """Four bytes: mantissas under a common exponent, rounded to nearest."""
    largest = max(rgb)
    exponent = math.frexp(largest)[1]
    if math.floor(math.ldexp(largest, 8 - exponent) + 0.5) > 255:
        exponent += 1
    scale = math.ldexp(1.0, 8 - exponent)
    return tuple(math.floor(c * scale + 0.5) for c in rgb) + (exponent + 128,)


def runs(values):
    """Run-length encoding of one channel of a scan line."""
    out, x = bytearray(), 0
    while x < len(values):
        end = x + 1
        while end < len(values) and end - x < 127 and values[end] == values[x]:
            end += 1
        if end - x >= 3:
            out += bytes((128 + end - x, values[x]))
            x = end
            continue
        end = x + 1
        while end < len(values) and end - x < 128 and values[end : end + 3] != [values[end]] * 3:
            end += 1
        out += bytes([end - x] + values[x:end])
        x = end
    return bytes(out)


def sky():
    out = bytearray(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n")
    out += f"-Y {SKY_HEIGHT} +X {SKY_WIDTH}\n".encode()
    for y in range(SKY_HEIGHT):
        line = [rgbe(sky_pixel(x, y)) for x in range(SKY_WIDTH)]
        out += bytes((2, 2, SKY_WIDTH >> 8, SKY_WIDTH & 255))
        for channel in range(4):
            out += runs([pixel[channel] for pixel in line])
    return bytes(out)


if __name__ == "__main__":
    for name, data in (("courtyard.glb", glb()), ("sky.hdr", sky())):
        (HERE / name).write_bytes(data)
        print(f"{name}: {len(data)} bytes")
