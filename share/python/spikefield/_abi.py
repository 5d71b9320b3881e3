"""The types and functions of spikefield.h in ctypes' words, checked against the library that is loaded."""
import ctypes
import glob
import os
from ctypes import POINTER, Structure, c_bool, c_char, c_double, c_float, c_int, c_int16, c_int32, c_int64, c_size_t, \
    c_uint32, c_uint64, c_void_p

import numpy as np

LAYERS, STEPS_MAX, DIRECTIONS, COUNTERS = 5, 8, 16, 512
MAJOR = 1  # of the library's soname: the types below are its


class Status(Structure):
    _fields_ = [("code", c_int), ("message", c_char * 400)]


class Info(Structure):
    """sf_info of spikefield.h, field by field."""
    _fields_ = [("inputs", c_int32 * LAYERS), ("outputs", c_int32 * LAYERS), ("theta", c_int32 * LAYERS),
                ("leak_q12", c_int32 * LAYERS), ("mode", c_int), ("steps", c_int32), ("grid_levels", c_int32),
                ("features", c_int32), ("directions", c_int32), ("max_samples", c_int32), ("occupancy_res", c_int32),
                ("step_q24", c_int32), ("background_q16", c_int32 * 3), ("grid_entries", c_int64),
                ("grid_bytes", c_int64), ("weight_bytes", c_int64), ("occupancy_bytes", c_int64),
                ("to_box_scale", c_double), ("to_box_offset", c_double * 3), ("stretch", c_double * 3),
                ("step", c_double), ("direction_lsb", c_double)]


PROGRESS = ctypes.CFUNCTYPE(c_bool, c_void_p, c_uint64, c_uint64)


class Options(Structure):
    _fields_ = [("steps", c_int32), ("threads", c_int32), ("progress", PROGRESS), ("user", c_void_p)]


class Camera(Structure):
    _fields_ = [("width", c_int32), ("height", c_int32), ("fx", c_float), ("fy", c_float), ("cx", c_float),
                ("cy", c_float), ("to_model", c_float * 12)]


EVENTS = ("mac", "sop", "spikes", "updates", "weight", "state_r", "state_w", "special")
LAYER_COUNTS = np.dtype([(name, "u8", STEPS_MAX) for name in EVENTS])
COUNTS = np.dtype([("layer", LAYER_COUNTS, LAYERS), ("samples", "u8"), ("rays", "u8"), ("grid_bytes", "u8"),
                   ("march_steps", "u8"), ("saturated", "u8", LAYERS), ("saturated_samples", "u8", LAYERS),
                   ("saturated_features", "u8"), ("field_samples", "u8"), ("field_mac", "u8")])
SAMPLE = np.dtype([("density", "u4"), ("colour", "u4", 3)])
PIXEL = np.dtype([("colour", "u8", 3), ("depth", "u8"), ("rgba", "u4", 4), ("weight_sum", "u4"),
                  ("transmittance", "u4"), ("samples", "u4")], align=True)


def trace_type(lanes):
    """What one sample left at every layer and time step."""
    return np.dtype([("spikes", "u8", (LAYERS, STEPS_MAX, lanes // 64)),
                     ("membrane", "i4", (LAYERS, STEPS_MAX, lanes)),
                     ("current", "i4", (LAYERS, STEPS_MAX, lanes))])


def shown_type(lanes):
    """A beat of the accelerator's tap."""
    return np.dtype([("spikes", "u8", lanes // 64), ("rows", "u8", lanes // 64), ("membrane", "i4", lanes)])


class Tap(Structure):
    _fields_ = [("index", c_uint32), ("features", POINTER(c_int16)), ("sample", c_void_p), ("trace", c_void_p)]


TAP = ctypes.CFUNCTYPE(c_bool, c_void_p, POINTER(Tap))

_S, _A = c_void_p, c_void_p  # a scene, an array
_FUNCTIONS = {
    "version": (ctypes.c_char_p, []),
    "lanes": (c_int32, []),
    "scene_open": (Status, [POINTER(c_void_p), ctypes.c_char_p]),
    "scene_close": (None, [_S]),
    "scene_describe": (Status, [_S, POINTER(Info)]),
    "counts_add": (None, [_A, _A]),
    "energy_fj": (c_uint64, [_A]),
    "relu_energy_fj": (c_uint64, [_S, c_uint64]),
    "position": (Status, [_S, _A, _A]),
    "direction": (Status, [_S, _A, _A]),
    "features": (Status, [_S, _A, c_size_t, _A, _A]),
    "samples": (Status, [_S, POINTER(Options), _A, _A, c_size_t, _A, _A, _A]),
    "samples_at": (Status, [_S, POINTER(Options), _A, _A, c_size_t, _A, _A, _A]),
    "trace_shown": (Status, [_S, POINTER(Options), _A, c_int32, c_int32, _A]),
    "counter_window": (None, [_S, _A, _A]),
    "pixel_distance": (c_double, [_S, _A]),
    "rays": (Status, [_S, POINTER(Options), _A, _A, c_size_t, _A, _A]),
    "frame": (Status, [_S, POINTER(Options), POINTER(Camera), _A, _A]),
    "ray_taps": (Status, [_S, POINTER(Options), _A, _A, TAP, c_void_p, _A, _A]),
}


def _candidates():
    """SPIKEFIELD_LIBRARY alone if it is set; else the wheel's own library, else what the loader finds."""
    if os.environ.get("SPIKEFIELD_LIBRARY"):
        return [os.environ["SPIKEFIELD_LIBRARY"]]
    here = os.path.dirname(os.path.abspath(__file__))
    return sorted(glob.glob(os.path.join(here, "libspikefield.so*"))) + [f"libspikefield.so.{MAJOR}"]


def load():
    """The library with the types of every function set; ImportError says what was tried."""
    tried = []
    for path in _candidates():
        try:
            library = ctypes.CDLL(path)
            for name, (result, arguments) in _FUNCTIONS.items():
                function = getattr(library, "spikefield_" + name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            tried.append(f"{path}: {error}")
            continue
        version = library.spikefield_version().decode()
        if int(version.split(".")[0]) != MAJOR:
            tried.append(f"{path}: version {version}, expected {MAJOR}.x")
            continue
        return library
    raise ImportError("libspikefield cannot be used (make install-lib, or set SPIKEFIELD_LIBRARY): " + "; ".join(tried))
