"""libspikefield for Python: the fixed-point core of the accelerator, bit for bit, in numpy arrays.

    import numpy as np, spikefield
    with spikefield.Scene("scene.snn") as scene:
        counts = spikefield.Counts()
        harmonics = scene.direction([0.0, 0.0, -1.0])
        out, trace = scene.samples(harmonics, features, counts=counts, traces=True)
        out["density"], out["colour"]               # uint32 [n], [n, 3]: U16.12 per box edge, U4.16
        spikefield.bits(trace["spikes"])             # bool [n, layer, step, neuron]
        counts.layer("C2")["sop"]                    # uint64 [step]

Every number comes from the library; units and ranges are those of spikefield.h. A call that fails raises
spikefield.Error with the library's line. A scene may be used by many threads at once, a Counts by one.
"""
import ctypes

import numpy as np

from . import _abi
from ._abi import COUNTERS, EVENTS

__all__ = ["Scene", "Counts", "Error", "LAYERS", "LANES", "EVENTS", "COUNTERS", "bits", "version"]

_lib = _abi.load()
LANES = _lib.spikefield_lanes()
LAYERS = ("D1", "D2", "C1", "C2", "C3")
_TRACE, _SHOWN = _abi.trace_type(LANES), _abi.shown_type(LANES)
version = _lib.spikefield_version().decode()
__version__ = version


class Error(Exception):
    """What the library refused: `code` as in spikefield_code (1 IO, 2 format, 3 range, ...), text in one line."""

    def __init__(self, status):
        super().__init__(status.message.decode(errors="replace"))
        self.code = status.code


def _checked(status):
    if status.code:
        raise Error(status)


def _array(values, kind, shape):
    """A C array of that type and shape (None: any length); ValueError where it has another shape or would lose bits."""
    given = np.asarray(values)
    array = np.asarray(given, dtype=kind, order="C")
    if np.dtype(kind).kind in "iu" and not np.array_equal(array, given):
        raise ValueError(f"a value does not fit {np.dtype(kind).name}")
    if len(array.shape) != len(shape) or any(w is not None and w != g for w, g in zip(shape, array.shape)):
        raise ValueError(f"shape {array.shape}, expected {tuple('n' if s is None else s for s in shape)}")
    return array


def _address(array):
    return None if array is None else array.ctypes.data


def _int(name, value):
    """The value as C's int, which ctypes would cut without a word."""
    if not -(1 << 31) <= value < 1 << 31:
        raise ValueError(f"{name} {value} is no 32-bit integer")
    return value


def bits(words):
    """Words of 64 neurons in the last axis -> bool, one neuron each: neuron n is bit n % 64 of word n / 64."""
    words = np.ascontiguousarray(words, dtype="<u8")
    return np.unpackbits(words.view(np.uint8), axis=-1, bitorder="little").astype(bool)


class Counts:
    """Events per layer and time step. Calls that get one add to it."""

    def __init__(self):
        self.raw = np.zeros((), _abi.COUNTS)  # every field of spikefield_counts

    def layer(self, name):
        """Events of "D1", "D2", "C1", "C2" or "C3": fields mac, sop, spikes, ...; uint64 [step] each."""
        return self.raw["layer"][LAYERS.index(name)]

    def __getattr__(self, name):
        if name == "raw" or name not in _abi.COUNTS.names:
            raise AttributeError(name)
        return self.raw[name]

    def __iadd__(self, more):
        _lib.spikefield_counts_add(_address(self.raw), _address(more.raw))
        return self

    @property
    def energy_fj(self):
        """4600 fJ per MAC, 900 fJ per SOP."""
        return _lib.spikefield_energy_fj(_address(self.raw))


class Scene:
    """A .snn file. Arguments that calls share: steps, time steps 1..8 (0: the scene's); threads (0: all); counts, a
    Counts that is added to."""

    def __init__(self, path):
        self._scene = ctypes.c_void_p()
        _checked(_lib.spikefield_scene_open(ctypes.byref(self._scene), str(path).encode()))
        self.info = _abi.Info()  # the fields of spikefield_scene_info
        _checked(_lib.spikefield_scene_describe(self._scene, ctypes.byref(self.info)))

    def close(self):
        """A closed scene refuses every call. Closing twice is fine."""
        if self._scene:
            _lib.spikefield_scene_close(self._scene)
            self._scene = ctypes.c_void_p()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __del__(self):
        if getattr(self, "_scene", None):
            self.close()

    @staticmethod
    def _options(steps=0, threads=0):
        return ctypes.byref(_abi.Options(steps=_int("steps", steps), threads=_int("threads", threads)))

    def relu_energy_fj(self, samples):
        """Of the ReLU twin: the same layers, every synapse a MAC."""
        return _lib.spikefield_relu_energy_fj(self._scene, samples)

    def window(self, counts):
        """uint64 [512]: what the accelerator's window of counters reads, at (event * 8 + layer) * 8 + step."""
        window = np.zeros(COUNTERS, np.uint64)
        _lib.spikefield_counter_window(self._scene, _raw(counts), _address(window))
        return window

    def position(self, model):
        """A point in model units, [3] -> box units Q0.24, uint32 [3]."""
        point, to = _array(model, np.float32, (3,)), np.zeros(3, np.uint32)
        _checked(_lib.spikefield_position(self._scene, _address(point), _address(to)))
        return to

    def direction(self, direction):
        """A viewing direction, [3] -> spherical harmonics, int16 [16]; TensoRF: the unit vector in the first three."""
        given, to = _array(direction, np.float32, (3,)), np.zeros(_abi.DIRECTIONS, np.int16)
        _checked(_lib.spikefield_direction(self._scene, _address(given), _address(to)))
        return to

    def features(self, positions, counts=None):
        """positions, uint32 [n, 3], Q0.24 -> int16 [n, features]; TensoRF: those of the direction are 0."""
        given = _array(positions, np.uint32, (None, 3))
        to = np.zeros((len(given), self.info.features), np.int16)
        _checked(_lib.spikefield_features(self._scene, _address(given), len(given), _address(to), _raw(counts)))
        return to

    def _samples(self, call, harmonics, inputs, steps, traces, counts):
        """What both fields' sample calls share: arrays made, addresses passed, the status checked."""
        given = _array(harmonics, np.int16, (_abi.DIRECTIONS,))
        out = np.zeros(len(inputs), _abi.SAMPLE)
        trace = np.zeros(len(inputs), _TRACE) if traces else None
        _checked(call(self._scene, self._options(steps), _address(given), _address(inputs), len(inputs), _address(out),
                      _address(trace), _raw(counts)))
        return (out, trace) if traces else out

    def samples(self, harmonics, features, steps=0, traces=False, counts=None):
        """Samples of one ray: harmonics int16 [16], features int16 [n, features] -> array [n] with density, colour.
        With traces=True also an array [n] with spikes, membrane, current, as in spikefield_trace."""
        inputs = _array(features, np.int16, (None, self.info.features))
        return self._samples(_lib.spikefield_samples, harmonics, inputs, steps, traces, counts)

    def samples_at(self, harmonics, positions, steps=0, traces=False, counts=None):
        """The same from positions, uint32 [n, 3], Q0.24."""
        inputs = _array(positions, np.uint32, (None, 3))
        return self._samples(_lib.spikefield_samples_at, harmonics, inputs, steps, traces, counts)

    def shown(self, trace, layer, step, steps=0):
        """What the accelerator's tap shows of one sample's trace, a record with spikes, rows and membrane."""
        to, one = np.zeros((), _SHOWN), _array(trace, _TRACE, ())
        _checked(_lib.spikefield_trace_shown(self._scene, self._options(steps), _address(one), _int("layer", layer),
                                             _int("step", step), _address(to)))
        return to

    def rays(self, origins, directions, steps=0, threads=0, counts=None):
        """origins, directions [n, 3], model units -> pixels [n] with rgba, colour, depth, samples, ..."""
        at, along = _array(origins, np.float32, (None, 3)), _array(directions, np.float32, (None, 3))
        if len(at) != len(along):
            raise ValueError(f"{len(at)} origins, {len(along)} directions")
        to = np.zeros(len(at), _abi.PIXEL)
        _checked(_lib.spikefield_rays(self._scene, self._options(steps, threads), _address(at), _address(along),
                                      len(at), _address(to), _raw(counts)))
        return to

    def frame(self, width, height, focal, to_model, centre=None, steps=0, threads=0, counts=None):
        """A picture: focal length in pixels, to_model [3, 4] -> pixels [height, width]; "rgba" is 0..65535."""
        pose = _array(to_model, np.float32, (3, 4))
        cx, cy = (width / 2, height / 2) if centre is None else centre
        camera = _abi.Camera(_int("width", width), _int("height", height), focal, focal, cx, cy, (ctypes.c_float * 12)(*pose.ravel()))
        to = np.zeros((max(height, 0), max(width, 0)), _abi.PIXEL)
        _checked(_lib.spikefield_frame(self._scene, self._options(steps, threads), ctypes.byref(camera), _address(to),
                                       _raw(counts)))
        return to

    def distance(self, pixel):
        """Mean distance from the camera of what a pixel's ray hit, model units; 0 where it hit nothing."""
        one = _array(pixel, _abi.PIXEL, ())
        return _lib.spikefield_pixel_distance(self._scene, _address(one))

    def ray(self, origin, direction, steps=0, counts=None):
        """One ray, its samples too: (pixel, features int16 [n, features], samples [n], traces [n])."""
        seen = []

        def tap(_, what):
            one = what.contents
            width = self.info.features
            seen.append((np.ctypeslib.as_array(one.features, (width,)).copy(),
                         np.frombuffer(ctypes.string_at(one.sample, _abi.SAMPLE.itemsize), _abi.SAMPLE)[0],
                         np.frombuffer(ctypes.string_at(one.trace, _TRACE.itemsize), _TRACE)[0]))
            return True

        at, along, to = _array(origin, np.float32, (3,)), _array(direction, np.float32, (3,)), np.zeros((), _abi.PIXEL)
        _checked(_lib.spikefield_ray_taps(self._scene, self._options(steps), _address(at), _address(along),
                                          _abi.TAP(tap), None, _address(to), _raw(counts)))
        features = np.array([f for f, _, _ in seen], np.int16).reshape(len(seen), self.info.features)
        return (to, features, np.array([s for _, s, _ in seen], _abi.SAMPLE),
                np.array([t for _, _, t in seen], _TRACE))


def _raw(counts):
    return None if counts is None else _address(counts.raw)
