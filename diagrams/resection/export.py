"""`trocar export`: a session as files that a viewer loads, in LPS and mm."""

from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
import SimpleITK as sitk

from diagrams.common.scenario import ScenarioError, refusals
from plants.tissue.execution import load_execution
from plants.tissue.labels import CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.tissue import Grid
from plants.tissue.volume import Volume
from systems.common.archive import beside, whole
from systems.resection.planning.resumed import load_session
from systems.resection.planning.session import Session

NOTHING, REMAINING, RESECTED, HEALTHY, BORED, VESSEL = range(6)
LABELS = ("nothing", "remaining", "resected", "healthy_removed", "bored", "critical")
"""What a label map's numbers mean."""

MM = 1e3
SIDES = 32
"""Of a channel's mesh."""

BACK = 0.060
"""Length in m of a channel's mesh before the tumour."""

Array = NDArray[np.float64]


def session_of(source: Path) -> Session:
    """The session of a file, or of the folder of a run that had one.

    Raises:
        ScenarioError: If there is none.
    """
    if source.is_dir():
        from diagrams.studies import load_scenario

        scenario = load_scenario(str(source / "scenario.yaml"))
        if not getattr(scenario, "session", ""):
            raise ScenarioError(
                f"{str(source)!r} was run without a session: expected "
                "--set session=FILE when it ran, or a session's file here"
            )
        source = Path(scenario.session)
    with refusals():
        return load_session(source)


def state(session: Session) -> NDArray[np.uint8]:
    """What each voxel is in the end, (nx, ny, nz) of `LABELS`.

    As it was carried out, as far as it was; as planned if nothing has been yet.
    """
    volume, tau = session.volume, session.volume.tau
    file = session.file and beside(session.file, "executed")
    if file is not None and file.is_file():
        with refusals():
            done = load_execution(file, session.postures, tau.shape)
        tau = tau if done.tau is None else done.tau
    gone, tumour = tau != SOLID, volume.labels == TUMOUR
    bored = np.isin(volume.labels, (CHANNEL, CAP))
    for channel in volume.more:
        bored |= volume.tube(channel) & gone & ~tumour
    label = np.zeros(volume.labels.shape, np.uint8)
    label[tumour & ~gone] = REMAINING
    label[tumour & gone] = RESECTED
    label[gone & ~tumour & ~bored] = HEALTHY
    label[volume.labels == CRITICAL] = VESSEL
    label[bored] = BORED
    return label


def on_grid(volume: Volume, label: NDArray[np.uint8], grid: Grid) -> NDArray[np.uint8]:
    """A label map of the volume on another grid, each label's volume kept.

    A label takes the voxels of which it has the largest shares, as many as it fills:
    first the tumour whole, of that what was resected, then all others.
    """
    X_IW = np.linalg.inv(grid.X_PI) @ volume.X_PW
    used = volume.points(label != NOTHING) @ X_IW[:3, :3].T + X_IW[:3, 3]
    low = np.maximum(np.floor(used.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(used.max(axis=0)).astype(int) + 2, grid.sizes)
    edges = np.linalg.norm(grid.X_PI[:3, :3], axis=0)
    parts = np.maximum(np.rint(edges / volume.spacing), 1).astype(int)
    X_WI = np.linalg.inv(X_IW)
    votes = np.zeros((*(high - low), len(LABELS)), np.uint16)
    index = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1)
    cells = tuple(np.indices(votes.shape[:3]))
    for part in np.ndindex(*parts):
        inner = (np.array(part) + 0.5) / parts - 0.5
        p = (index + inner) @ X_WI[:3, :3].T + X_WI[:3, 3]
        at = np.rint((p - volume.origin) / volume.spacing).astype(int)
        on = ((at >= 0) & (at < volume.labels.shape)).all(axis=-1)
        at = np.where(on[..., None], at, 0)
        votes[(*cells, np.where(on, label[tuple(np.moveaxis(at, -1, 0))], 0))] += 1
    voxel = abs(float(np.linalg.det(grid.X_PI[:3, :3])))
    count = np.bincount(label.reshape(-1), minlength=len(LABELS)) * volume.voxel / voxel
    shares = votes.reshape(-1, len(LABELS)) / float(np.prod(parts))
    flat = np.zeros(len(shares), np.uint8)

    def take(share: Array, free: NDArray[np.bool_], wanted: float, name: int) -> None:
        rank = np.where(free, share, -np.inf)
        best = np.argsort(-rank, kind="stable")[: round(wanted)]
        flat[best[rank[best] > -np.inf]] = name

    tumour = shares[:, REMAINING] + shares[:, RESECTED]
    take(tumour, tumour > 0.0, count[REMAINING] + count[RESECTED], REMAINING)
    taken = flat == REMAINING
    take(shares[:, RESECTED] - shares[:, REMAINING], taken, count[RESECTED], RESECTED)
    for name in (VESSEL, BORED, HEALTHY):
        free = (flat == NOTHING) & (shares[:, name] > 0.0)
        take(shares[:, name], free, count[name], name)
    result = np.zeros(grid.sizes, np.uint8)
    box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    result[box] = flat.reshape(votes.shape[:3])
    return result


def write_label_map(path: Path, label: NDArray[np.uint8], X_PI: Array) -> Path:
    """Writes a label map as the name's ending says: .nrrd or .nii.gz.

    Args:
        path: The file.
        label: Of voxels, (nx, ny, nz).
        X_PI: From indices to P in m, (4, 4).
    """
    spacing = np.linalg.norm(X_PI[:3, :3], axis=0)
    image = sitk.GetImageFromArray(np.ascontiguousarray(label.transpose(2, 1, 0)))
    image.SetSpacing((MM * spacing).tolist())
    image.SetDirection((X_PI[:3, :3] / spacing).reshape(-1).tolist())
    image.SetOrigin((MM * X_PI[:3, 3]).tolist())
    sitk.WriteImage(image, str(path), True)
    return path


def path_vtk(session: Session) -> str:
    """The tool's path as VTK PolyData in LPS and mm, the entry at each point."""
    X = session.volume.X_PW
    tips = MM * (session.tips @ X[:3, :3].T + X[:3, 3])
    lines = ["# vtk DataFile Version 3.0", "tool path; SPACE=LPS", "ASCII"]
    lines += ["DATASET POLYDATA", f"POINTS {len(tips)} double"]
    lines += [" ".join(f"{v:.5f}" for v in p) for p in tips]
    lines += [f"LINES 1 {len(tips) + 1}"]
    lines += [f"{len(tips)} " + " ".join(map(str, range(len(tips))))]
    lines += [f"POINT_DATA {len(tips)}", "SCALARS entry int 1", "LOOKUP_TABLE default"]
    lines += [str(int(entry)) for entry in session.entries]
    return "\n".join(lines) + "\n"


def channels_obj(session: Session) -> str:
    """The access channels as tubes in LPS and mm, one object each."""
    volume = session.volume
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    rows = ["# LPS, mm"]
    frames = [np.eye(4), *(channel.X_WE for channel in volume.more)]
    for number, X_WE in enumerate(frames):
        X = volume.X_PW @ X_WE
        rows.append(f"o channel_{number + 1}")
        for z in (-BACK, volume.depth):
            ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)])
            p = volume.channel * ring + [0.0, 0.0, z]
            p = MM * (p @ X[:3, :3].T + X[:3, 3])
            rows += ["v " + " ".join(f"{v:.5f}" for v in q) for q in p]
        first = 1 + 2 * SIDES * number
        for k in range(SIDES):
            a, b = first + k, first + (k + 1) % SIDES
            rows.append(f"f {a} {b} {b + SIDES} {a + SIDES}")
    return "\n".join(rows) + "\n"


def plan_of(session: Session, label: NDArray[np.uint8]) -> dict[str, Any]:
    """The plan as plain data: SI units, frames as in the house's pages."""
    volume = session.volume
    counts = np.bincount(label.reshape(-1), minlength=len(LABELS)) * volume.voxel
    return {
        "frames": "P is LPS in m; W is the first channel's; postures are in each E",
        "labels": dict(enumerate(LABELS)),
        "volumes": dict(zip(LABELS[1:], counts[1:].tolist(), strict=True)),
        "X_PW": volume.X_PW.tolist(),
        "X_WE": [np.eye(4).tolist(), *(c.X_WE.tolist() for c in volume.more)],
        "channel": {"radius": volume.channel, "depth": volume.depth},
        "robot": asdict(session.own),
        "steps": [asdict(step) for step in session.steps],
        "postures": session.postures.tolist(),
        "entries": session.entries.tolist(),
        "tool_radii": session.tool_radii.tolist(),
    }


def export(session: Session, folder: Path) -> list[Path]:
    """Writes what a viewer can load; returns the files.

    Raises:
        ScenarioError: If the folder cannot be written to.
    """
    volume, label = session.volume, state(session)
    X_WV = np.diag([*[volume.spacing] * 3, 1.0])
    X_WV[:3, 3] = volume.origin
    files: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if volume.image is not None:
            own = on_grid(volume, label, volume.image)
            for name in ("labels.nrrd", "labels.nii.gz"):
                files.append(write_label_map(folder / name, own, volume.image.X_PI))
        fine = folder / "labels_fine.nrrd"
        files.append(write_label_map(fine, label, volume.X_PW @ X_WV))
        texts = {
            "path.vtk": path_vtk(session),
            "channels.obj": channels_obj(session),
            "plan.json": json.dumps(plan_of(session, label), indent=1) + "\n",
        }
        for name, text in texts.items():
            with whole(folder / name) as draft:
                draft.write_text(text)
            files.append(folder / name)
    except (OSError, RuntimeError) as error:
        raise ScenarioError(f"cannot write to {str(folder)!r}: {error}") from error
    return files
