import os
import sys

import numpy as np
import oracles
import pytest
from map_file_cases import (
    ODD_METADATA,
    arrays_of,
    box,
    cylinder,
    finished,
    killed_while_it_writes,
    mapped,
    memory_and_seconds,
    with_junk,
)

from robots import InputError
from surrogate.maps import netcdf
from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.netcdf import write_netcdf

xr = oracles.load("xarray")
oracles.load("h5netcdf")
h5py = oracles.load("h5py")

SWEEP = Layout(
    "joints", tuple(Axis(name, "deg", np.linspace(-20.0, 50.0, 3)) for name in ("q4_deg", "q2_deg", "q5_deg"))
)
SLICE = Layout("slice", (box().axes[0], box().axes[2]))
LAYOUTS = {
    "box": (box(), ("z_mm", "y_mm", "x_mm")),
    "slice": (SLICE, ("z_mm", "x_mm")),
    "cylinder": (cylinder(np.arange(0.0, 360.0, 60.0)), ("z_mm", "phi_deg", "r_mm")),
    "joints": (SWEEP, ("q4_deg", "q2_deg", "q5_deg")),
}


def with_holes(layout):
    return np.random.default_rng(1).uniform(size=layout.n) < 0.8


def small_blocks(monkeypatch):
    for module in ("columns", "netcdf"):
        monkeypatch.setattr(f"surrogate.maps.{module}.ROWS_A_BLOCK", 7)


@pytest.mark.parametrize("kind", LAYOUTS)
def test_xarray_reads_every_variable_and_coordinate(tmp_path, kind, monkeypatch):
    small_blocks(monkeypatch)
    layout, names = LAYOUTS[kind]
    data = finished(layout, with_holes(layout), {"robot": "xr701", "load direction": "-Z"})
    write_netcdf(mapped(data, tmp_path), tmp_path / "map.nc")
    write_netcdf(data, tmp_path / "map.nc")  # over the one before
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        assert dict(back.sizes) == dict(zip(names, layout.shape, strict=True))
        for name, axis in zip(names, layout.axes, strict=True):
            np.testing.assert_array_equal(back[name], axis.values)
            assert back[name].attrs["units"] == ("mm" if name.endswith("mm") else "degree")
        expected = {name: values for name, values in arrays_of(data).items() if name not in names}
        assert set(back.data_vars) == {*expected, "reached"}
        for name, values in expected.items():
            assert back[name].dims == names
            # A factor of 100 or 180/pi stands between: round-off.
            np.testing.assert_allclose(back[name].values.ravel(), values, rtol=2e-15, err_msg=name)
        np.testing.assert_array_equal(back["reached"].values.ravel(), data.reached)
        for i, name in enumerate(("x_mm", "y_mm", "z_mm")):
            points = np.broadcast_to(back.coords[name], layout.shape) if name not in names else None
            if points is not None:
                np.testing.assert_allclose(points.ravel(), data.points[:, i] * 1e3, rtol=1e-15)
        assert back.attrs["load_direction"] == "-Z"
        assert back.attrs["Conventions"].startswith("CF-1.")
        assert back.attrs["layout"] == kind


def test_units_words_and_flags(tmp_path):
    write_netcdf(finished(box()), tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        stiffness, part = back["stiffness_N_per_mm"], back["softest_part"]
        assert (stiffness.attrs["units"], stiffness.attrs["long_name"]) == ("N/mm", "stiffness along -Z")
        assert back["isotropy"].attrs["units"] == "1"
        assert back["q2_deg"].attrs["units"] == "degree"
        assert part.dtype == np.int32
        np.testing.assert_array_equal(part.attrs["flag_values"], [-1, 0, 1, 2])
        # One word a value, as CF wants it; the names themselves besides.
        assert part.attrs["flag_meanings"].split() == ["none", "link_2", "gr_te_", "base"]
        assert list(part.attrs["categories"]) == ["link 2", "größte <&>", "base"]
        assert "units" not in part.attrs


def test_a_point_is_found_by_its_place(tmp_path):
    layout = box()
    data = finished(layout)
    write_netcdf(data, tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        found = back["stiffness_N_per_mm"].sel(x_mm=-90.0, y_mm=90.0, z_mm=50.0).item()
    row = np.flatnonzero(np.isclose(data.points, [-0.09, 0.09, 0.05]).all(axis=1))
    assert found == data.fields["stiffness_N_per_mm"].values[row[0]]


def test_odd_words_survive(tmp_path):
    write_netcdf(finished(box(), metadata=ODD_METADATA), tmp_path / "ü map.nc")
    with xr.open_dataset(tmp_path / "ü map.nc", engine="h5netcdf") as back:
        assert back.attrs["note"] == ODD_METADATA["note"]
        assert back.attrs["long"] == ODD_METADATA["long"]
        assert back.attrs["empty"] == ""
        assert back.attrs["load_direction________größe"] == "-Z"
        assert back.attrs["control_"] == "zero\ufffdbyte, lone ? surrogate"


def test_names_that_become_the_same_stay_apart(tmp_path):
    layout = box()
    full = finished(layout)
    fields = {"a b": Field(np.zeros(layout.n), "", ""), "a_b": Field(np.ones(layout.n), "", "")}
    metadata = {"c d": "1", "c_d": "2", "layout": "3", "": "4"}
    data = MapData(layout, full.points, full.q, full.reached, full.coordinates, fields, metadata=metadata)
    write_netcdf(data, tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        assert (float(back["a_b"].max()), float(back["a_b_"].min())) == (0.0, 1.0)
        assert [back.attrs[name] for name in ("c_d", "c_d_", "layout_", "n")] == ["1", "2", "3", "4"]


def test_a_map_out_of_reach_and_single_precision(tmp_path):
    layout = box(1, 1, 1)
    write_netcdf(finished(layout, np.zeros(1, dtype=bool)), tmp_path / "map.nc", single=True)
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        assert back["stiffness_N_per_mm"].dtype == np.float32
        assert back["x_mm"].dtype == np.float64
        assert np.isnan(back["stiffness_N_per_mm"]).all()
        assert back["softest_part"].item() == -1


def test_bad_places_and_a_full_disk_are_named(tmp_path, monkeypatch):
    data = finished(box())
    with pytest.raises(InputError, match=r"ends in \.nc"):
        write_netcdf(data, tmp_path / "map.vtu")
    with pytest.raises(InputError, match="existing folder"):
        write_netcdf(data, tmp_path / "nowhere" / "map.nc")

    def full(*_):
        raise RuntimeError("Can't write data (No space left on device)")

    monkeypatch.setattr(netcdf, "_fill", full)
    with pytest.raises(InputError, match="No space left"):
        write_netcdf(data, tmp_path / "map.nc")
    assert list(tmp_path.iterdir()) == []


def test_what_stands_where_nothing_is_reached_is_not_shown(tmp_path):
    layout = box()
    data = with_junk(finished(layout, with_holes(layout)))
    write_netcdf(data, tmp_path / "map.nc")
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        np.testing.assert_array_equal(np.isnan(back["q2_deg"].values.ravel()), ~data.reached)


def test_no_more_disk_is_used_than_was_claimed(tmp_path, monkeypatch):
    claimed = []
    monkeypatch.setattr(netcdf, "claim_disk", lambda stream, n_bytes: claimed.append(n_bytes))
    write_netcdf(finished(box(20, 30, 40), metadata=ODD_METADATA), tmp_path / "map.nc")
    assert (tmp_path / "map.nc").stat().st_size < claimed[0]


@pytest.mark.parametrize("package", ["h5netcdf", "h5py"])
def test_a_missing_package_is_named(tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"{package}.*stiffarm\[netcdf\]"):
        write_netcdf(finished(box()), tmp_path / "map.nc")


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="the system cannot claim disk space")
def test_a_file_too_large_leaves_nothing(tmp_path):
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(InputError, match="could not be written"):
            write_netcdf(finished(box(10, 20, 30)), tmp_path / "map.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_a_killed_process_leaves_the_file_before(tmp_path):
    assert killed_while_it_writes("netcdf", "write_netcdf", tmp_path / "map.nc") == -9
    assert len(list(tmp_path.iterdir())) == 2  # the other is the hidden one
    with xr.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        expected = finished(box()).fields["stiffness_N_per_mm"].values
        np.testing.assert_array_equal(back["stiffness_N_per_mm"].values.ravel(), expected)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_does_not_grow_with_the_map(tmp_path):
    sizes = {n: memory_and_seconds("netcdf", "write_netcdf", ".nc", n, tmp_path / str(n))[0] for n in (10, 40)}
    slope = (sizes[40] - sizes[10]) / 1.5e6  # bytes a point; 50 000 points a layer
    print(f".nc: {sizes[40] / 1e6:.0f} MB at 2e6 points, {slope:.1f} B a point")
    # A block of rows at a time, whatever the map: nothing but noise of the allocator grows.
    assert sizes[40] + slope * 8e6 < 4e8
