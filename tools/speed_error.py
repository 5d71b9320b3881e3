#!/usr/bin/env python3
"""Speed against error (make speed-error): what a picture costs in seconds, cycles and energy, and what it loses, for many ways to
make it. One table, one picture, one page.

usage: speed_error.py BUILD [--profile quick|full|smoke] [--data FOLDER] [--view K] [--report]
  --profile  quick (default): the demo's model and short trainings, some 15 minutes; full: trainings of up to 30 minutes, some two
             hours; smoke: a tiny scene of its own, seconds
  --data     a data set in place of the demo's scene; its models are trained here
  --view     held-out view that is rendered (default 0)
  --report   no runs: table, picture and page of what is there
Results: BUILD/speed-error/PROFILE/{table.md,points.json,speed-error.svg,speed-error.html}. Finished points are kept in points/, while
their command and their model stay the same."""
import argparse
import hashlib
import html
import json
import math
import os
import platform
import re
import subprocess
import sys

PROFILES = {
    "quick": {"minutes": [1, 2], "tensorf": 2, "repeat": 3},
    "full": {"minutes": [1, 2, 5, 15, 30], "tensorf": 15, "repeat": 5},
    "smoke": {"minutes": [], "tensorf": 0, "repeat": 1},
}
TINY = "--stage1 40 --stage2 80 --samples 2048 --levels 6 --log2-hash 12 --finest-res 64 --lattice 128 --occ-res 32".split()
TINY_TENSORF = "--stage1 10 --stage2 10 --samples 1024 --rays 256 --voxels 24 --occ-res 16".split()
KERNELS = ["portable", "avx2", "avx512vnni", "amx"]
RTL_WINDOW = 16
# Axis: key, title, unit, factor from what the programs print.
COSTS = [("seconds", "time of a frame on this CPU", "s"), ("cycles", "the accelerator's cycles of a frame", "cycles"),
         ("mj", "energy of a frame, paper's ledger", "mJ")]
# Group: title, colour (also in the page's key).
GROUPS = {
    "steps": ("time steps 1..T", "#0072b2"),
    "widths": ("narrower integers", "#e69f00"),
    "fit": ("fitted scenes", "#009e73"),
    "arithmetic": ("arithmetic", "#cc79a7"),
    "training": ("training time", "#d55e00"),
    "backbone": ("TensoRF", "#56b4e9"),
}


def in_table(point):
    """Groups as above; names with numbers by these; instruction sets as they are listed."""
    name = point["name"]
    words = [float(w) if n % 2 else w for n, w in enumerate(re.split(r"(\d+(?:\.\d+)?)", name))]
    return list(GROUPS).index(point["group"]), KERNELS.index(name) if name in KERNELS else -1, words


class Failed(Exception):
    pass


def run(command):
    """Standard output of a program of ours; its error is ours."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Failed(done.stderr.strip().split("\n")[-1] or f"{command[0]}: exit status {done.returncode}")
    return done.stdout


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class Bench:
    """The folder of a profile, and how its points are made."""

    def __init__(self, build, profile, data, view):
        self.bin = os.path.join(build, "bin")
        self.out = os.path.join(build, "speed-error", profile)
        self.profile, self.view, self.limits = profile, view, PROFILES[profile]
        self.data = data or os.path.join(build, "demo", "scene")
        self.demo = None if data or profile == "smoke" else os.path.join(build, "demo", "model.safetensors")
        self.own = profile == "smoke" and not data
        if self.own:
            self.data = os.path.join(self.out, "scene")
        for folder in ("points", "models", "scenes"):
            os.makedirs(os.path.join(self.out, folder), exist_ok=True)

    def program(self, name, *arguments):
        return [os.path.join(self.bin, name), *map(str, arguments)]

    def path(self, folder, name):
        return os.path.join(self.out, folder, name)

    # ---- models ----

    def prepare(self):
        """The model that most points are made from."""
        if self.own and not os.path.isdir(self.data):
            run(self.program("sf_scene", "textured", "-o", self.data, "--size", 32, "--train", 10, "--test", 2, "-q"))
        if not os.path.isdir(self.data):
            raise Failed(f"{self.data}: no such folder (make demo, or --data FOLDER)")
        if self.demo:
            if not os.path.exists(self.demo):
                raise Failed(f"{self.demo}: not there: make demo first")
            return self.demo
        return self.train("base", TINY if self.profile == "smoke" else ["--minutes", 2])

    def train(self, name, options):
        """The model `name`, trained unless it is there; a model that is cut short is never taken."""
        model = self.path("models", f"{name}.safetensors")
        if not os.path.exists(model):
            partial = self.path("models", f"{name}.part.safetensors")
            print(f"  training {name}", flush=True)
            run(self.program("sf_train", self.data, "-o", partial, "--eval-views", 1, "-q", *options))
            os.replace(partial, model)
        return model

    # ---- points ----

    def export(self, name, model, options):
        scene = self.path("scenes", f"{name}.snn")
        run(self.program("sf_export", model, "-o", scene, "-q", *options))
        return scene

    def render(self, scene, *options):
        picture = self.path("scenes", "picture.exr")
        return json.loads(run(self.program("sim_render", scene, self.data, "--view", self.view, "-o", picture, "--json", "-q", *options)))

    def fastest(self, scene, *options):
        """The report of one of several runs, with the time of the fastest: others disturb, nothing speeds up."""
        reports = [self.render(scene, *options) for _ in range(self.limits["repeat"])]
        return reports[0] | {"seconds": min(report["seconds"] for report in reports)}

    def fixed(self, scene, model, *options):
        report = self.fastest(scene, *options)
        cycles = json.loads(run(self.program("sf_cycles", scene, self.data, "--view", self.view, "--json", "-q")))
        return {"psnr": report["psnr"], "float_psnr": self.float_psnr(model), "seconds": report["seconds"], "cycles": cycles["cycles"],
                "mj": report["energy_fj"] / 1e12, "samples": report["samples"], "t_r": report["t_r"]}

    def float_psnr(self, model):
        """Of the model as it was learned: what the integers and their options lose is lost against this."""
        kept = self.path("models", f"{sha256(model)[:16]}-{self.view}.psnr")
        if not os.path.exists(kept):
            report = self.render(self.export("float", model, []), "--backend", "float", "--model", model)
            with open(kept + ".part", "w", encoding="utf-8") as file:
                json.dump(report["psnr"], file)
            os.replace(kept + ".part", kept)
        with open(kept, encoding="utf-8") as file:
            return json.load(file)

    def float_point(self, model):
        report = self.fastest(self.export("float", model, []), "--backend", "float", "--model", model)
        return {"psnr": report["psnr"], "float_psnr": report["psnr"], "seconds": report["seconds"], "samples": report["samples"],
                "t_r": report["t_r"]}

    def rtl_point(self, model):
        """Verilator's time for the whole frame: that of a window in the middle, by samples."""
        scene = self.export("rtl", model, [])
        whole, window = self.render(scene), self.render(scene, "--backend", "rtl")
        if not window["samples"]:
            raise Failed(f"view {self.view}: no sample in the {RTL_WINDOW} x {RTL_WINDOW} pixels in its middle: give another --view")
        point = self.fixed(scene, model)
        return point | {"seconds": window["seconds"] * whole["samples"] / window["samples"]}

    def point(self, group, name, model, options, make):
        """Makes a point unless the one of before is of the same model and options."""
        path = self.path("points", f"{group}-{name}.json")
        made_of = {"model": sha256(model), "options": [str(o) for o in options], "view": self.view, "repeat": self.limits["repeat"]}
        if os.path.exists(path):
            with open(path, encoding="utf-8") as file:
                if json.load(file)["made_of"] == made_of:
                    return
        print(f"  {group}: {name}", flush=True)
        try:
            result = make()
        except Failed as why:
            if "not on this machine" not in str(why):
                raise
            print(f"  {group}: {name}: not on this machine", flush=True)
            return
        with open(path + ".part", "w", encoding="utf-8") as file:
            json.dump({"group": group, "name": name, "made_of": made_of} | result, file, indent=1)
        os.replace(path + ".part", path)

    def exported(self, group, name, model, options):
        self.point(group, name, model, options, lambda: self.fixed(self.export(f"{group}-{name}", model, options), model))

    def make_points(self):
        """All points of the profile, one after the other; those that are there are kept."""
        base, smoke = self.prepare(), self.profile == "smoke"
        for steps in range(1, 9):
            self.exported("steps", f"t = {steps}", base, ["--steps", steps])
        for option, widths in (("weight", [4] if smoke else [6, 5, 4]), ("grid", [] if smoke else [6, 4]), ("feature", [] if smoke else [10, 8])):
            for bits in widths:
                self.exported("widths", f"{option}s of {bits} bits", base, [f"--{option}-bits", bits])
        for loss in [0.05] if smoke else [0, 0.05, 0.2, 0.5]:
            rays = ["--fit-rays", 512] if smoke else []
            self.exported("fit", f"fit, {loss:g} dB", base, ["--fit", "--data", self.data, "--fit-loss", loss, *rays])
        self.point("arithmetic", "float", base, [], lambda: self.float_point(base))
        for kernels in KERNELS:
            self.point("arithmetic", kernels, base, [kernels],
                       lambda k=kernels: self.fixed(self.export("arithmetic", base, []), base, "--kernels", k))
        self.point("arithmetic", "RTL in Verilator", base, [], lambda: self.rtl_point(base))
        for minutes in self.limits["minutes"]:
            self.exported("training", f"{minutes} min", self.train(f"minutes-{minutes}", ["--minutes", minutes]), [])
        tensorf = TINY_TENSORF if smoke else ["--minutes", self.limits["tensorf"]]
        name = "TensoRF" if smoke else f"TensoRF, {self.limits['tensorf']} min"
        self.exported("backbone", name, self.train("tensorf", ["--backbone", "tensorf", *tensorf]), [])

    def points(self):
        """The points on disk, in the table's order."""
        found = []
        for name in sorted(os.listdir(self.path("points", ""))):
            if name.endswith(".json"):
                with open(self.path("points", name), encoding="utf-8") as file:
                    found.append(json.load(file))
        return sorted(found, key=in_table)


# ---- fronts ----

def mark_fronts(points):
    """A point is on the front of a cost where no other is as good and as cheap, and better in one."""
    for key, _, _ in COSTS:
        priced = [p for p in points if key in p]
        for p in priced:
            beaten = any(q["psnr"] >= p["psnr"] and q[key] <= p[key] and (q["psnr"] > p["psnr"] or q[key] < p[key]) for q in priced)
            if not beaten:
                p.setdefault("fronts", []).append(key)


# ---- table, picture, page ----

def excess(p):
    """Mean squared error above that of the same model in float."""
    return 10 ** (-p["psnr"] / 10) - 10 ** (-p["float_psnr"] / 10)


def cells(p):
    """A point as the cells of its row; a star marks a front."""
    marks = p.get("fronts", [])
    row = [GROUPS[p["group"]][0], p["name"], f"{p['psnr']:.2f}", f"{p['float_psnr'] - p['psnr']:.2f}", f"{1e5 * excess(p):.2f}"]
    for key, _, _ in COSTS:
        row.append("-" if key not in p else f"{p[key]:.4g}{' *' if key in marks else ''}" if key != "cycles"
                   else f"{p[key]:d}{' *' if key in marks else ''}")
    return row


HEAD = ["group", "point", "dB", "dB lost against float", "excess, 1e-5"] + [f"{title}, {unit}" if unit != "cycles" else title for _, title, unit in COSTS]


def table(points):
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    return "\n".join(lines + ["| " + " | ".join(cells(p)) + " |" for p in points]) + "\n"


def ticks(low, high):
    """Powers of ten and their 2 and 5 inside a logarithmic axis."""
    found = [m * 10.0**e for e in range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1) for m in (1, 2, 5)]
    found = [t for t in found if low <= t <= high]
    return [t for t in found if f"{t:e}"[0] == "1"] if len(found) > 6 else found


def panel(points, key, title, unit, top, left, width, height):
    """PSNR over one cost, logarithmic; its front is a line."""
    shown = [p for p in points if key in p]
    low, high = min(p[key] for p in shown) / 1.3, max(p[key] for p in shown) * 1.3
    worst, best = min(p["psnr"] for p in points) - 0.3, max(p["psnr"] for p in points) + 0.3

    def at(p):
        return (left + width * math.log(p[key] / low) / math.log(high / low), top + height * (best - p["psnr"]) / (best - worst))

    svg = [f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#8a919b"/>',
           f'<text x="{left + width / 2:.1f}" y="{top + height + 36}" text-anchor="middle">{title}{"" if unit == "cycles" else ", " + unit}</text>']
    for t in ticks(low, high):
        x = left + width * math.log(t / low) / math.log(high / low)
        svg.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + height}" stroke="#e3e6ea"/>'
                   f'<text x="{x:.1f}" y="{top + height + 17}" text-anchor="middle" class="n">{t:g}</text>')
    step = 1 if best - worst < 8 else 2 if best - worst < 16 else 5
    for level in range(math.ceil(worst / step) * step, math.floor(best) + 1, step):
        y = top + height * (best - level) / (best - worst)
        svg.append(f'<line x1="{left}" y1="{y:.1f}" x2="{left + width}" y2="{y:.1f}" stroke="#e3e6ea"/>'
                   f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end" class="n">{level}</text>')
    front = sorted((at(p) for p in shown if key in p.get("fronts", [])))
    svg.append('<polyline fill="none" stroke="#1c2127" stroke-dasharray="4 3" points="' + " ".join(f"{x:.1f},{y:.1f}" for x, y in front) + '"/>')
    for p in shown:
        x, y = at(p)
        on = key in p.get("fronts", [])
        colour = GROUPS[p["group"]][1]
        svg.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{5 if on else 3.5}" fill="{colour if on else "#fff"}" stroke="{colour}" '
                   f'stroke-width="1.5"><title>{html.escape(p["name"])}: {p["psnr"]:.2f} dB, {p[key]:.4g} {unit}</title></circle>')
    return svg


def picture(points):
    """The SVG: a panel for each cost, a legend below."""
    panels = [cost for cost in COSTS if any(cost[0] in p for p in points)]
    wide, tall = 360, 300
    total = 60 + len(panels) * (wide + 60)
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total} {tall + 110}" width="{total}" height="{tall + 110}">',
           "<style>text{font:13px system-ui,'DejaVu Sans',sans-serif;fill:#1c2127}.n{font-size:11.5px;fill:#5b6470}</style>",
           f'<rect width="{total}" height="{tall + 110}" fill="#fff"/><text x="14" y="26">PSNR, dB</text>']
    for i, (key, title, unit) in enumerate(panels):
        svg += panel(points, key, title, unit, 40, 60 + i * (wide + 60), wide, tall)
    x = 60
    for group, (title, colour) in GROUPS.items():
        if any(p["group"] == group for p in points):
            svg.append(f'<circle cx="{x}" cy="{tall + 94}" r="5" fill="{colour}"/><text x="{x + 10}" y="{tall + 98}">{title}</text>')
            x += 30 + 8 * len(title)
    return "\n".join(svg + ["</svg>"]) + "\n"


PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Speed against error</title><style>
body{{font:15px/1.5 system-ui,'DejaVu Sans',sans-serif;color:#1c2127;margin:24px auto;max-width:1320px;padding:0 16px}}
svg{{max-width:100%;height:auto}}table{{border-collapse:collapse}}td,th{{padding:3px 10px;border-bottom:1px solid #e3e6ea;text-align:left}}
td:nth-child(n+3){{text-align:right;font-variant-numeric:tabular-nums}}</style></head><body>
<h1>Speed against error</h1>
<p>{about}</p>
{svg}
<p>Filled circles are on the front of their panel, and so are figures with * in the table: no other point is as good and as cheap. Point
at a circle to read its name. Seconds are those of the fastest of {repeat} runs, with all threads. Cycles are the cycle model's
(<code>sf_cycles</code>). Energy is 0.9 pJ for a SOP, 4.6 pJ for a MAC. <em>RTL in Verilator</em> is measured on a window and scaled by samples.</p>
<table><thead><tr>{head}</tr></thead><tbody>
{rows}
</tbody></table></body></html>
"""


def page(bench, points, svg):
    """The HTML page: the picture and the table."""
    about = (f"View {bench.view} of {os.path.basename(os.path.dirname(bench.data)) or '.'}/{os.path.basename(bench.data)}, profile {bench.profile}. "
             f"CPU: {cpu()}, {os.cpu_count()} threads. dB lost, and excess, which is squared error: against the same model in float, at its own number of steps.")
    rows = "\n".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells(p)) + "</tr>" for p in points)
    head = "".join(f"<th>{html.escape(h)}</th>" for h in HEAD)
    return PAGE.format(about=html.escape(about), svg=svg, repeat=bench.limits["repeat"], head=head, rows=rows)


def cpu():
    """The processor's name."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def write(bench, name, text):
    with open(os.path.join(bench.out, name + ".part"), "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(os.path.join(bench.out, name + ".part"), os.path.join(bench.out, name))


def report(bench):
    """Write table, JSON, picture and page of the points on disk."""
    points = bench.points()
    if not points:
        raise Failed(f"{bench.out}: no points: run it without --report")
    mark_fronts(points)
    svg = picture(points)
    write(bench, "points.json", json.dumps([p | {"excess_squared_error": excess(p)} for p in points], indent=1))
    write(bench, "table.md", table(points))
    write(bench, "speed-error.svg", svg)
    write(bench, "speed-error.html", page(bench, points, svg))
    print(table(points), end="")
    print(f"{bench.out}/speed-error.html: {len(points)} points")


def main():
    parser = argparse.ArgumentParser(usage=__doc__, add_help=True)
    parser.add_argument("build")
    parser.add_argument("--profile", choices=PROFILES, default="quick")
    parser.add_argument("--data")
    parser.add_argument("--view", type=int, default=0)
    parser.add_argument("--report", action="store_true")
    o = parser.parse_args()
    bench = Bench(o.build, o.profile, o.data, o.view)
    try:
        if not o.report:
            bench.make_points()
        report(bench)
    except Failed as why:
        sys.exit(f"speed_error: {why}")
    except KeyboardInterrupt:
        sys.exit("speed_error: interrupted; the same command goes on")


main()
