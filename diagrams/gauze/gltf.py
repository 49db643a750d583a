"""Surfaces as glTF, with a material that looks wet: for Drake's renderer."""

import base64
import io
import json

import matplotlib
import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from plants.organs.posed_organs import normals
from plants.organs.surface import Surface

_TILES = 14.0
"""Repeats of the texture in a metre."""


def _uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def texture(rgb: tuple[float, float, float], seed: int, size: int = 128) -> bytes:
    """A tileable PNG of a colour with soft mottles and a few darker veins."""
    rng = np.random.default_rng(seed)
    k = np.fft.fftfreq(size) * size
    power = 1.0 / (1.0 + (np.hypot(*np.meshgrid(k, k)) / 3.0) ** 1.8)
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * power).real
    noise /= noise.std()
    veins = np.exp(-((noise / 0.12) ** 2)) * (np.roll(noise, size // 3, 0) > 0.3)
    shade = 1.0 + 0.10 * noise - 0.22 * veins
    image = np.clip(np.array(rgb) * shade[..., None], 0.0, 1.0)
    out = io.BytesIO()
    matplotlib.image.imsave(out, image, format="png")
    return out.getvalue()


def gltf(
    surface: Surface,
    name: str,
    rgb: tuple[float, float, float],
    roughness: float = 0.32,
    seed: int = 0,
) -> Mesh:
    """A surface with a wet look."""
    points = surface.points.astype(np.float32)
    outwards = normals(surface).astype(np.float32)
    places = _TILES * np.stack([points[:, 0] + points[:, 2], points[:, 1]], axis=1)
    arrays: list[np.ndarray] = [points, outwards, places.astype(np.float32)]
    arrays.append(surface.triangles.astype(np.uint32).ravel())
    data = [np.ascontiguousarray(a).tobytes() for a in arrays]
    starts = np.cumsum([0, *map(len, data)]).tolist()
    kinds = ("VEC3", "VEC3", "VEC2", "SCALAR")
    count = [len(points)] * 3 + [3 * len(surface.triangles)]
    accessors: list[dict[str, object]] = [
        {
            "bufferView": i,
            "componentType": 5125 if i == 3 else 5126,
            "count": count[i],
            "type": kinds[i],
        }
        for i in range(4)
    ]
    accessors[0] |= {
        "min": points.min(axis=0).tolist(),
        "max": points.max(axis=0).tolist(),
    }
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
    }
    whole = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name, "rotation": [-(0.5**0.5), 0, 0, 0.5**0.5]}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
                        "indices": 3,
                        "material": 0,
                    }
                ]
            }
        ],
        "materials": [material],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 10497, "wrapT": 10497}],
        "images": [{"uri": _uri(texture(rgb, seed), "image/png")}],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": starts[i], "byteLength": len(data[i])}
            for i in range(4)
        ],
        "buffers": [
            {
                "byteLength": starts[-1],
                "uri": _uri(b"".join(data), "application/octet-stream"),
            }
        ],
    }
    file = MemoryFile(json.dumps(whole), ".gltf", f"{name}.gltf")
    return Mesh(InMemoryMesh(mesh_file=file), 1.0)
