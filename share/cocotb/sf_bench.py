"""The bench inside the simulator: programs the block, streams a kit's rays, compares with libspikefield.

sf_cocotb.py starts it; the variable SF_COCOTB names a JSON file with kit, scene, steps, seed, stalls, tap and counters.
A ray is one test: its results, spikes, rows and membranes, and with "each" every counter. Test "counters" compares the
sum of all rays."""
import json
import logging
import os
import time

import cocotb
import numpy as np
from cocotb.result import SimTimeoutError
from cocotb.triggers import ClockCycles, Edge, RisingEdge, with_timeout
from cocotbext.axi import AxiLiteBus, AxiLiteMaster, AxiResp, AxiStreamBus, AxiStreamFrame, AxiStreamSink, AxiStreamSource

import spikefield
from spikefield import LANES, LAYERS

CSR = {"CTRL": 0x00C, "STATUS": 0x010, "ERROR": 0x014, "COUNTERS": 0x1000}
START, SOFT_RESET, CLEAR, SNAPSHOT = 1, 2, 4, 8
STATUS_COUNTERS = 4
GLOBAL_LAYER, GLOBAL_TIMES = 7, (2, 3, 4, 5)  # cycles, busy and stalls are time: the library counts events
PATIENCE_NS = 1_000_000  # 100000 cycles without a result
QUIET = 64  # cycles after the last result: nothing more may come
ENOUGH = 480  # stalls (percent) times samples, from where on every channel has to have waited
VALUES = 4  # of 16 bits a beat
SPIKING = ("D1", "C1", "C2")

with open(os.environ["SF_COCOTB"], encoding="utf-8") as given:
    config = json.load(given)
scene = spikefield.Scene(config["scene"])
STEPS = scene.info.steps
DECODES = scene.info.grid_levels == 0
for noisy in ("cocotb.sf_cocotb_top", "cocotb.sf_cocotb_top.s_axil", "cocotb.scheduler"):
    logging.getLogger(noisy).setLevel(logging.WARNING)


def kit_lines(name):
    with open(os.path.join(config["kit"], name), encoding="ascii") as lines:
        return [int(line, 16) for line in lines]


def packets():
    """The kit's stimulus: a list of values (int16), one for each packet."""
    found, values = [], []
    for beat in kit_lines("stimulus.hex"):
        values.append(beat & (1 << 64) - 1)
        if beat >> 64 & 1:
            found.append(np.array(values, "<u8").view("<i2"))
            values = []
    return found


def rays():
    """(name, packets) of each ray of the kit."""
    with open(os.path.join(config["kit"], "manifest.json"), encoding="utf-8") as file:
        listed = json.load(file)["rays"]
    stream, at = packets(), 0
    for number, ray in enumerate(listed):
        view = "".join(c if c.isalnum() else "_" for c in ray["view"])
        yield f"ray_{number:04d}_{view}_{ray['x']}_{ray['y']}", stream[at:at + ray["samples"]]
        at += ray["samples"]


def split(packed):
    """harmonics [16] and features [n, features] of a ray's packets; what pads a beat is left out."""
    directions = 0 if DECODES else scene.info.directions
    beats = -(-directions // VALUES)
    harmonics = np.zeros(16, np.int16)
    harmonics[:directions] = packed[0][:directions]
    rest = [packed[0][beats * VALUES:]] + packed[1:]
    return harmonics, np.array([values[:scene.info.features] for values in rest], np.int16)


async def patiently(what, trouble):
    try:
        return await with_timeout(what, PATIENCE_NS, "ns")
    except SimTimeoutError:
        raise AssertionError(f"{trouble} within {PATIENCE_NS // 10} cycles") from None


class Block:
    """The buses of the block, for one test."""

    def __init__(self, dut):
        self.dut, self.tap = dut, {layer: [] for layer in range(len(LAYERS))}
        self.bus = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axil"), dut.clk)
        self.source = AxiStreamSource(AxiStreamBus.from_prefix(dut, "s_axis"), dut.clk, byte_lanes=1)
        dut.m_axis_tready.value = 0

    def stream(self):
        """Let samples through, and begin to watch the tap."""
        # A sink that is told to pause before it runs never sleeps again, so there is none until results are wanted.
        self.sink = AxiStreamSink(AxiStreamBus.from_prefix(self.dut, "m_axis"), self.dut.clk, byte_lanes=1)
        if config["tap"]:
            cocotb.start_soon(self._watch_tap())

    async def _watch_tap(self):
        """Tap beats by layer: (step, spikes, rows, membranes), integers but the step."""
        dut, lanes, change = self.dut, (1 << LANES) - 1, Edge(self.dut.tap_beat)
        parts = [getattr(dut, f"tap_membrane_{i}") for i in (3, 2, 1, 0)]
        while True:
            await change
            tap = dut.tap.value.integer
            layer = tap >> 2 * LANES + 3
            neurons = scene.info.outputs[layer] if layer < len(LAYERS) and LAYERS[layer] in SPIKING else 0
            membranes = int("".join(part.value.binstr for part in parts)[-24 * neurons:], 2) if neurons else 0  # lanes without a neuron show anything
            self.tap.setdefault(layer, []).append((tap >> 2 * LANES & 7, tap >> LANES & lanes, tap & lanes, membranes))

    async def write(self, offset, value):
        answer = await patiently(self.bus.write(offset, value.to_bytes(4, "little")), f"register {offset:03x}: no answer to a write")
        self.check_order()
        assert answer.resp == AxiResp.OKAY, f"register {offset:03x}: response {int(answer.resp)} to a write"

    async def read(self, offset, words=1):
        answer = await patiently(self.bus.read(offset, 4 * words), f"register {offset:03x}: no answer to a read")
        self.check_order()
        assert answer.resp == AxiResp.OKAY, f"register {offset:03x}: response {int(answer.resp)} to a read"
        return answer.data

    def check_order(self):
        assert not self.dut.early.value, "a register answered before it was asked"

    async def counters_done(self):
        while int.from_bytes(await self.read(CSR["STATUS"]), "little") & STATUS_COUNTERS:
            pass

    async def window(self):
        """uint64 [512], as of now."""
        await self.write(CSR["CTRL"], SNAPSHOT)
        await self.counters_done()
        return np.frombuffer(await self.read(CSR["COUNTERS"], 2 * spikefield.COUNTERS), "<u8")


def lane_bits(words):
    return int.from_bytes(np.asarray(words, "<u8").tobytes(), "little")


def packed_membranes(membrane):
    """LANES x 24 bits, lane 0 lowest, as the tap has them."""
    low = np.ascontiguousarray(membrane.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3])
    return int.from_bytes(low.tobytes(), "little")


def first_neuron(expected, actual, bits):
    """(neuron, its expected value, its actual value) of the first difference."""
    neuron = ((expected ^ actual) & -(expected ^ actual)).bit_length() - 1
    neuron //= bits
    sign = 1 << bits - 1 if bits > 1 else 0
    both = [value >> bits * neuron & (1 << bits) - 1 for value in (expected, actual)]
    return (neuron, *((value ^ sign) - sign for value in both))


def compare_tap(layer, step, shown, beat, where):
    """Rows, spikes and membranes of one beat of the tap against the fixed-point core. AssertionError names the neuron."""
    name = f"{where} layer {LAYERS[layer]} step {step}"
    actual_step, spikes, rows, membranes = beat
    assert actual_step == step, f"{name}: the tap shows step {actual_step}"
    parts = [("row", lane_bits(shown["rows"]), rows, 1)] if LAYERS[layer] in ("D2", "C2", "C3") else []
    if LAYERS[layer] in SPIKING:
        parts.append(("spike", lane_bits(shown["spikes"]), spikes, 1))
        parts.append(("membrane", packed_membranes(shown["membrane"]), membranes, 24))
    for what, expected, actual, bits in parts:
        if expected != actual:
            neuron, wanted, got = first_neuron(expected, actual, bits)
            raise AssertionError(f"{name} neuron {neuron} {what}: expected {wanted}, actual {got}")


def tap_beats(layer):
    """Of a sample: one for each step of a spiking layer, one of the others; none of a layer that a decoder lacks."""
    return 0 if scene.info.outputs[layer] == 0 else STEPS if LAYERS[layer] in SPIKING else 1


def compare_taps(block, traces):
    """By sample, then layer, then step: the first difference is the cause of the others."""
    places = [(layer, step) for layer in range(len(LAYERS)) for step in range(tap_beats(layer))]
    for at, trace in enumerate(traces):
        for layer, step in places:
            place = at * tap_beats(layer) + step
            assert place < len(block.tap[layer]), f"sample {at} layer {LAYERS[layer]} step {step}: no tap beat"
            compare_tap(layer, step, scene.shown(trace, layer, step), block.tap[layer][place], f"sample {at}")
    for layer, beats in block.tap.items():
        wanted = len(traces) * tap_beats(layer) if layer < len(LAYERS) else 0
        assert len(beats) == wanted, f"layer {layer}: {len(beats)} tap beats of {len(traces)} samples, expected {wanted}"


def compare_result(at, frame, sample):
    """A sample's two beats of m_axis: density and three channels of colour, 32 bits each."""
    beats = frame.tdata
    assert len(beats) == 2, f"sample {at}: a result of {len(beats)} beats, expected 2"
    low = (1 << 32) - 1
    actual = [beats[0] & low, beats[0] >> 32, beats[1] & low, beats[1] >> 32]
    expected = [int(sample["density"]), *map(int, sample["colour"])]
    for name, wanted, got in zip(("density", "colour 0", "colour 1", "colour 2"), expected, actual):
        assert wanted == got, f"sample {at} {name}: expected {wanted}, actual {got}"


def compare_window(actual, counts):
    """Every counter of the window against the core's, but those of time, which the core does not have."""
    expected = scene.window(counts)
    for at in np.flatnonzero(actual != expected):
        event, layer, step = at // 64, at // 8 % 8, at % 8
        if layer == GLOBAL_LAYER and (event == 1 or step in GLOBAL_TIMES):
            continue
        where = f"layer {LAYERS[layer]} step {step} {spikefield.EVENTS[event]}" if layer < len(LAYERS) else f"place {at}"
        if layer == GLOBAL_LAYER and event == 0 and step < 2:
            where = ("samples", "rays")[step]
        raise AssertionError(f"counter {where}: expected {expected[at]}, actual {actual[at]}")


async def stream_ray(block, packed):
    """A ray in, its results and tap beats out, all compared; its counts."""
    counts = spikefield.Counts()
    harmonics, features = split(packed)
    out, traces = scene.samples(harmonics, features, counts=counts, traces=True)
    config["expected"] += counts
    block.stream()
    for at, values in enumerate(packed):
        beats = [int(beat) for beat in values.view("<u8")]
        user = [int(at == 0 or DECODES)] + [0] * (len(beats) - 1)
        block.source.send_nowait(AxiStreamFrame(beats, tuser=user))
    frames = [await patiently(block.sink.recv(compact=False), f"sample {at}: no result") for at in range(len(out))]
    await ClockCycles(block.dut.clk, QUIET)
    if config["tap"]:
        compare_taps(block, traces)
    for at, (frame, sample) in enumerate(zip(frames, out)):
        compare_result(at, frame, sample)
    assert block.sink.empty() and not block.sink.active, f"a result after the last of {len(out)} samples"
    assert not block.dut.unstable.value, "a result changed before it was taken"
    assert not block.dut.irq.value, "interrupt"
    return counts


def ray_test(name, packed):
    """A coroutine that is the test case `name`: it streams one ray and compares everything."""
    async def one(dut):
        start = time.process_time()
        block = Block(dut)
        await RisingEdge(dut.clk)
        if config["failed"]:  # the ray before may have left samples in the queue and inside
            dut.forget.value = 1
            await ClockCycles(dut.clk, 2)
            dut.forget.value = 0
            await block.write(CSR["CTRL"], SOFT_RESET)
            await block.write(CSR["CTRL"], START)
        if config["counters"] == "each":
            await block.write(CSR["CTRL"], CLEAR)
            await block.counters_done()
        config["failed"] = True
        counts = await stream_ray(block, packed)
        if config["counters"] == "each":
            compare_window(await block.window(), counts)
        config["failed"] = False
        config["compared"] += len(packed)
        config["seconds"] += time.process_time() - start
    one.__name__ = one.__qualname__ = name
    return cocotb.test()(one)


@cocotb.test()
async def program(dut):
    """Reset, and what the driver writes; every answer is OKAY and nothing is refused."""
    block = Block(dut)
    dut.often.value, dut.seed.value = config["stalls"] * 256 // 100, config["seed"] & 0xFFFFFFFF
    dut.rst_n.value = 0
    await ClockCycles(dut.clk, 4)
    dut.rst_n.value = 1
    await ClockCycles(dut.clk, 4)
    for write in kit_lines("program.hex"):
        await block.write(write >> 32, write & 0xFFFFFFFF)
    await block.counters_done()
    error = int.from_bytes(await block.read(CSR["ERROR"]), "little")
    assert error == 0, f"ERROR is {error:#x} after the programming"


config.update(failed=False, compared=0, seconds=0.0, expected=spikefield.Counts())
for ray_name, ray_packets in rays():
    globals()[ray_name] = ray_test(ray_name, ray_packets)


@cocotb.test()
async def counters(dut):
    """Every counter of all rays together, or that of the last one."""
    assert config["compared"], "no ray was compared"
    start = time.process_time()
    if config["counters"] == "end":
        assert config["compared"] == config["expected"].samples, "rays have failed: their events are not all counted"
        compare_window(await Block(dut).window(), config["expected"])
        config["seconds"] += time.process_time() - start
    waited = dut.waited.value.integer
    assert config["stalls"] or not waited, "a channel waited without stalls"
    assert config["stalls"] * config["compared"] < ENOUGH or waited == 0x7F, f"channels that never waited: {waited ^ 0x7F:07b}"
    with open(config["summary"], "w", encoding="utf-8") as file:
        json.dump({"samples": config["compared"], "seconds": config["seconds"]}, file)
