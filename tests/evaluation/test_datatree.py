"""An evaluation in ArviZ's layout, read back by xarray."""

import arviz_base
import numpy as np
import pytest
import xarray
from made_results import OTHER, PS, SIR, batch, imported, make

from jaxpf import InputError
from jaxpf.evaluation.output.datatree import write_datatree


def test_runs_are_chains_and_frames_are_draws(tmp_path):
    truth = np.full((3, 2, 4), 5.0)
    boxes = truth + np.arange(4.0)[:, None, None, None]
    # Of SIR two runs, in two files; of PS a third one is done; imported tracks have none.
    given = [
        (SIR, [batch(boxes[:1]), batch(boxes[1:2], first_run=1)]),
        (PS, [batch(boxes[:3] + 10)]),
        (OTHER, [imported(truth)]),
    ]
    output = tmp_path / "runs.nc"
    write_datatree(output, make(tmp_path / "made", given, truth, ids=(4, 9), start_frame=7))
    with xarray.open_datatree(output, engine="h5netcdf") as tree:
        estimate = tree["posterior"]["estimate"]
        assert estimate.dims == ("chain", "draw", "configuration", "object", "value")
        assert estimate.draw.values.tolist() == [8, 9, 10]
        assert estimate.object.values.tolist() == [4, 9]
        assert estimate.configuration.values.tolist() == ["SIR", "PS 21"]
        np.testing.assert_array_equal(estimate.sel(configuration="SIR")[:2], boxes[:2])
        assert np.isnan(estimate.sel(configuration="SIR")[2]).all()
        np.testing.assert_array_equal(estimate.sel(configuration="PS 21"), boxes[:3] + 10)
        np.testing.assert_array_equal(tree["observed_data"]["truth"], truth)
        assert tree["sample_stats"]["ess"].shape == (3, 3, 2)
        # ArviZ's own way to take chains and draws together.
        both = arviz_base.extract(tree, var_names="estimate")
        assert both.sizes["sample"] == 9


def test_an_evaluation_without_runs_is_refused(tmp_path):
    truth = np.full((3, 2, 4), 5.0)
    results = make(tmp_path / "made", [(OTHER, [imported(truth)])], truth)
    with pytest.raises(InputError, match="holds no runs; evaluate first"):
        write_datatree(tmp_path / "runs.nc", results)
