"""Vector kits, and the runs of their bench."""
import os
import re
import shutil
import subprocess

from hdl_flow import Spent, Stop, digest, hash_of

SHORT = 48  # samples of the kit that planted errors meet
PATIENCE = "+patience=10000"  # a block that hangs ends the run; also in the run without errors, so none that is only slow
TRAINING = ["--stage1", "20", "--stage2", "40", "--samples", "512", "--levels", "4", "--log2-hash", "10", "--finest-res", "32", "--lattice", "64",
            "--occ-res", "16", "--hidden", "32", "--steps", "3", "--quiet"]


class Kits:
    """The kit of all samples and the short one, in BUILD/netlist/kit*; made when they are first asked for."""

    def __init__(self, work):
        self.work, self.arguments = work, work.arguments

    def whole(self):
        return self.kit(self.arguments.samples)

    def short(self):
        return self.kit(min(SHORT, self.arguments.samples))

    def program(self, name, *arguments):
        """Run a program of the build; Stop with its last line when it fails."""
        path = os.path.join(self.work.programs, name)
        if not os.path.exists(path):
            raise Stop(f"{path} is not there: make")
        done = subprocess.run([path, *arguments], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise Stop((done.stderr.strip().splitlines() or [f"{name} failed"])[-1])

    def scene(self):
        """(scene, data): the user's, or one with nets of 32 neurons, which fit a small block."""
        if self.arguments.scene:
            return self.arguments.scene, self.arguments.data
        folder = os.path.join(self.work.folder, "scene")
        scene, data = os.path.join(folder, "scene.snn"), os.path.join(folder, "data")
        if not os.path.exists(scene):
            self.work.say("a scene of 32 neurons a layer")
            shutil.rmtree(folder, ignore_errors=True)
            os.makedirs(folder)
            model = os.path.join(folder, "model.safetensors")
            self.program("sf_scene", "textured", "-o", data, "--size", "24", "--train", "8", "--test", "2")
            self.program("sf_train", data, "-o", model, *TRAINING)
            self.program("sf_export", model, "-o", scene + ".aside")
            os.replace(scene + ".aside", scene)
        return scene, data

    def kit(self, samples):
        """The folder of a vector kit of so many samples; made once for a scene."""
        scene, data = self.scene()
        folder = os.path.join(self.work.folder, f"kit-{samples}")
        key = digest(hash_of(scene), os.path.abspath(data), str(samples), hash_of(os.path.join(self.work.programs, "sf_export")))
        try:
            with open(folder + ".key", encoding="utf-8") as file:
                if file.read() == key and os.path.exists(os.path.join(folder, "manifest.json")):
                    return folder
        except OSError:
            pass
        self.program("sf_export", scene, "--vectors", folder, "--data", data, "--samples", str(samples), "--seed", "1")
        with open(folder + ".key", "w", encoding="utf-8") as file:
            file.write(key)
        return folder


def simulate(kit, simulator, sources, include, build, lanes, with_tap, quick, argument):
    """Runs the kit's bench on the sources: (passed, its line, samples, seconds of processor time). quick: to build, not to run.
    argument: a plusarg of the simulation, or "".

    Raises Stop where nothing was compared."""
    command = ["nice", "-n", "10", "make", "-s", "-C", kit, simulator, "SOURCES=" + " ".join(sources), "RTL=" + include, "BUILD=" + build]
    command += [f"LANES={lanes}"] if lanes else []
    command += [] if with_tap else ["TAP=0"]
    command += ["OPT=-O0"] if quick else []
    command += [f"ARGS={PATIENCE} {argument}"]
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    spent = Spent()
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    seconds = spent.processor()
    lines = (done.stdout + done.stderr).splitlines()
    said = next((line for line in lines if re.match(r"PASS|DIFFERENCE|FAIL", line)), "")
    if not said:
        wrong = [line for line in lines if re.search("rror|FATAL", line)] or lines[-1:] or ["no output"]
        raise Stop(f"{simulator}: {wrong[0]}, see {build}")
    passed = done.returncode == 0 and said.startswith("PASS")
    samples = int(said.split()[1]) if passed else 0
    return passed, said, samples, seconds
