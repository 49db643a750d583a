"""A resection of a patient's mask, up to where planning begins."""

import numpy as np
import pytest

from diagrams.resection.operation import new_session
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.labels import CAP, CRITICAL, TUMOUR
from plants.tissue.mask_labels import MaskLabels
from plants.tissue.volume import Access
from tests.plants.tissue.mask_files import write_mask


def test_a_session_on_a_mask(tmp_path, capsys):
    """Its volume is kept, its line of single voxels too, and what is left out said."""
    axis = np.arange(36) - 18
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    labels = (x**2 + y**2 + z**2 <= 13**2).astype(np.uint8)
    labels[17 + 18, :, 18] = 2
    labels[1, 1, 1] = 1
    path = write_mask(tmp_path / "P.nii.gz", labels)
    session, name = new_session(
        ResectionScenario(
            mask=str(path),
            labels=MaskLabels(critical=[2]),
            access=Access(direction=[0.3, 0.2, -1.0]),
            spacing=2e-3,
        )
    )
    volume, own = session.volume, 1e-9 * np.count_nonzero(labels == 1) - 1e-9
    assert name == "P.nii.gz"
    assert volume.mask_volume == pytest.approx(own)
    whole = np.isin(volume.labels, (TUMOUR, CAP)).sum() * volume.voxel
    assert whole == pytest.approx(own, rel=0.01)
    assert (volume.labels == CRITICAL).sum() * volume.voxel > 36e-9
    assert 0.0 < volume.to_critical[volume.labels == TUMOUR].min() < 5e-3
    said = capsys.readouterr().err
    assert "trocar: P.nii.gz: of what is tumour 1 mm3 in 1 parts" in said


def test_a_synthetic_tumour_is_called_that(capsys):
    session, name = new_session(
        ResectionScenario(access=Access(direction=[0.0, 0.0, -1.0]), spacing=2e-3)
    )
    assert name == "synthetic tumour 1"
    assert session.volume.mask_volume is None
    assert capsys.readouterr().err == ""
