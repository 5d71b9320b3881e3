#!/usr/bin/env python3
"""The Python package beside a vector kit of the same scene, and beside itself on other ways to the same numbers.

usage: python_package.py SCENE KIT     needs numpy and the package spikefield"""
import json
import os
import sys
import threading
import unittest

import numpy as np

import spikefield

SCENE, KIT = sys.argv[1:3]


def kit(name):
    with open(os.path.join(KIT, name), encoding="ascii") as lines:
        return [int(line, 16) for line in lines]


def integer(words):
    return int.from_bytes(np.asarray(words, "<u8").tobytes(), "little")


class Kit(unittest.TestCase):
    """sf_export wrote what must come out; the package gets the same inputs."""

    def setUp(self):
        self.scene = spikefield.Scene(SCENE)
        self.addCleanup(self.scene.close)
        with open(os.path.join(KIT, "manifest.json"), encoding="utf-8") as file:
            self.rays = json.load(file)["rays"]
        self.counts = spikefield.Counts()
        self.samples, self.traces = [], []
        packets, beats = [], []
        for beat in kit("stimulus.hex"):
            beats.append(beat & (1 << 64) - 1)
            if beat >> 64 & 1:
                packets.append(np.array(beats, "<u8").view("<i2"))
                beats = []
        at = 0
        directions, width = self.scene.info.directions, self.scene.info.features
        for ray in self.rays:
            packed = packets[at:at + ray["samples"]]
            at += ray["samples"]
            harmonics = np.zeros(16, np.int16)
            harmonics[:directions] = packed[0][:directions]
            packed[0] = packed[0][-(-directions // 4) * 4:]
            out, traces = self.scene.samples(harmonics, [p[:width] for p in packed], traces=True, counts=self.counts)
            self.samples.extend(out)
            self.traces.extend(traces)

    def test_results(self):
        wanted = kit("expected_outputs.hex")
        self.assertEqual(len(wanted), 2 * len(self.samples))
        for at, sample in enumerate(self.samples):
            colour = [int(c) for c in sample["colour"]]
            self.assertEqual([int(sample["density"]) | colour[0] << 32, colour[1] | colour[2] << 32], wanted[2 * at:2 * at + 2])

    def test_counters(self):
        self.assertEqual(self.scene.window(self.counts).tolist(), kit("expected_counters.hex"))

    def test_taps(self):
        steps = self.scene.info.steps
        for layer, name in ((0, "D1"), (2, "C1"), (3, "C2")):
            spikes, membranes = kit(f"expected_spikes_{name}.hex"), kit(f"expected_membranes_{name}.hex")
            for at, trace in enumerate(self.traces):
                for step in range(steps):
                    shown = self.scene.shown(trace, layer, step)
                    low = shown["membrane"].astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
                    self.assertEqual(integer(shown["spikes"]), spikes[at * steps + step])
                    self.assertEqual(int.from_bytes(low, "little"), membranes[at * steps + step])
        for layer, name, beats in ((1, "D2", 1), (3, "C2", steps), (4, "C3", 1)):
            rows = kit(f"expected_rows_{name}.hex")
            for at, trace in enumerate(self.traces):
                for step in range(beats):
                    self.assertEqual(integer(self.scene.shown(trace, layer, step)["rows"]), rows[at * beats + step])

    def test_spikes_are_counted(self):
        fired = spikefield.bits(np.array([t["spikes"] for t in self.traces])).sum(axis=(0, 3))
        for layer, name in enumerate(spikefield.LAYERS):
            if name in ("D1", "C1", "C2"):
                self.assertEqual(fired[layer].tolist(), self.counts.layer(name)["spikes"].tolist())
        self.assertGreater(self.counts.energy_fj, 0)
        self.assertEqual(self.counts.samples, len(self.samples))


class Pictures(unittest.TestCase):
    def setUp(self):
        self.scene = spikefield.Scene(SCENE)
        self.addCleanup(self.scene.close)
        info = self.scene.info
        centre = (0.5 / np.array(info.stretch) - np.array(info.to_box_offset)) / info.to_box_scale
        back = 1.2 / info.to_box_scale
        self.pose = np.hstack([np.eye(3), (centre + [0, 0, back])[:, None]])

    def test_frame_rays_and_taps_agree(self):
        counts, again, taps = spikefield.Counts(), spikefield.Counts(), spikefield.Counts()
        pixels = self.scene.frame(8, 6, 8.0, self.pose, counts=counts)
        self.assertEqual(pixels.shape, (6, 8))
        x, y = np.meshgrid(np.arange(8), np.arange(6))
        along = np.stack([(x + 0.5 - 4) / 8, -(y + 0.5 - 3) / 8, np.full_like(x, -1.0, float)], -1).reshape(-1, 3)
        origins = np.broadcast_to(self.pose[:, 3], along.shape)
        rays = self.scene.rays(origins, along, threads=1, counts=again)
        self.assertEqual(rays.tobytes(), pixels.tobytes())
        self.assertEqual(again.raw.tobytes(), counts.raw.tobytes())
        self.assertGreater(counts.samples, 0)
        self.assertTrue((pixels["weight_sum"] + pixels["transmittance"] == 1 << 20).all())
        for at, pixel in enumerate(rays):
            one, features, samples, traces = self.scene.ray(origins[at], along[at], counts=taps)
            self.assertEqual(one.tobytes(), pixel.tobytes())
            out, other = self.scene.samples(self.scene.direction(along[at]), features, traces=True)
            self.assertEqual((out.tobytes(), other.tobytes()), (samples.tobytes(), traces.tobytes()))
        self.assertEqual(taps.raw.tobytes(), counts.raw.tobytes())

    def test_positions(self):
        middle = self.scene.position(self.pose[:, 3] - [0, 0, 1.2 / self.scene.info.to_box_scale])
        self.assertTrue((abs(middle.astype(int) - (1 << 23)) < 16).all(), middle)
        harmonics = self.scene.direction([0, 0, -1])
        features = self.scene.features([middle])
        self.assertEqual(self.scene.samples(harmonics, features).tobytes(), self.scene.samples_at(harmonics, [middle]).tobytes())

    def test_threads_share_a_scene(self):
        wanted, got = self.scene.frame(16, 16, 16.0, self.pose).tobytes(), []
        threads = [threading.Thread(target=lambda: got.append(self.scene.frame(16, 16, 16.0, self.pose, threads=1).tobytes())) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(got, [wanted] * 4)


class Refused(unittest.TestCase):
    def test_files(self):
        with self.assertRaisesRegex(spikefield.Error, "nowhere.snn") as missing:
            spikefield.Scene("nowhere.snn")
        self.assertEqual(missing.exception.code, 1)
        with self.assertRaises(spikefield.Error) as damaged:
            spikefield.Scene(__file__)
        self.assertEqual(damaged.exception.code, 2)

    def test_values(self):
        with spikefield.Scene(SCENE) as scene:
            features = np.zeros((2, scene.info.features), np.int64)
            features[1, 3] = 2048
            with self.assertRaisesRegex(spikefield.Error, "feature 3 of sample 1 is 2048"):
                scene.samples(np.zeros(16), features)
            features[1, 3] = 1 << 16
            with self.assertRaisesRegex(ValueError, "does not fit int16"):
                scene.samples(np.zeros(16), features)
            features[1, 3] = 0
            with self.assertRaisesRegex(ValueError, "shape"):
                scene.samples(np.zeros(16), features[:, 1:])
            with self.assertRaisesRegex(spikefield.Error, "steps"):
                scene.samples(np.zeros(16), features[:1], steps=9)
            at, along = np.zeros((1, 3)), np.array([[0, 0, 1.0]])
            for wide in ({"steps": (1 << 32) + 1}, {"threads": (1 << 32) + 1}, {"steps": -(1 << 31) - 1}):
                with self.assertRaisesRegex(ValueError, "is no 32-bit integer"):
                    scene.rays(at, along, **wide)
            pose = np.eye(3, 4)
            with self.assertRaisesRegex(ValueError, "width 4294967300 is no"):
                scene.frame((1 << 32) + 4, 4, 4.0, pose)
            centred = scene.frame(4, 4, 4.0, pose, centre=np.array([2.0, 2.0]))
            self.assertEqual(centred.tobytes(), scene.frame(4, 4, 4.0, pose).tobytes())
            trace = scene.samples(np.zeros(16), features[:1], traces=True)[1][0]
            for place in ((1 << 32, 0), (0, 1 << 32)):
                with self.assertRaisesRegex(ValueError, "is no 32-bit integer"):
                    scene.shown(trace, *place)
            for layer, step, what in ((5, 0, "layer is 5"), (0, 8, "step is 8"), (-1, 0, "layer is -1")):
                with self.assertRaisesRegex(spikefield.Error, what):
                    scene.shown(trace, layer, step)
        with self.assertRaisesRegex(spikefield.Error, "scene is NULL"):
            scene.direction([0, 0, 1])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
