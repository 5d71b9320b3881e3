"""The pages in a browser. usage: browse.py BUILD WORK CHROMIUM; WORK holds trained.snn, model.safetensors, set/."""
import json
import os
import signal
import subprocess
import sys
import time

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

BUILD, WORK, CHROMIUM = sys.argv[1:4]
SHOTS = os.path.join(BUILD, "tests", "view")
SIZE = 48


def check(holds, text):
    if not holds:
        sys.exit(f"browse: {text}")


def program(name, *arguments):
    return subprocess.run([os.path.join(BUILD, "bin", name), *arguments], cwd=WORK, check=True, capture_output=True)


class Served:
    """A program that prints its page's address first, on standard output or error."""

    def __init__(self, name, *arguments, stream="stdout"):
        self.process = subprocess.Popen([os.path.join(BUILD, "bin", name), *arguments], cwd=WORK, text=True,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.url = getattr(self.process, stream).readline().strip().split(" ")[-1]
        if not self.url.startswith("http://127.0.0.1:"):
            sys.exit(f"browse: {name} printed no address but: {self.url} {self.process.communicate()[1]}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        status = self.process.wait(timeout=20)
        check(status in (0, 130), f"Ctrl-C: exit status {status}")


def open_browser():
    options = Options()
    options.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={WORK}/profile"):
        options.add_argument(word)
    options.add_experimental_option("prefs", {"download.default_directory": WORK})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


def look(browser, width, height, dark):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia",
                            {"features": [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]})


def until(browser, script, what, seconds=40):
    end = time.time() + seconds
    while time.time() < end:
        got = browser.execute_script(script)
        if got:
            return got
        time.sleep(0.05)
    problem = browser.execute_script("return document.getElementById('problem').textContent")
    return sys.exit(f"browse: {what} did not come; the page says: {problem or 'nothing'}")


def whole(browser, side="left"):
    until(browser, f"return document.getElementById('stage').dataset.{side} === 'whole'", f"the {side} picture")


def pixels(browser, canvas):
    """R, G, B of every pixel."""
    return browser.execute_script(
        "var c = document.getElementById(arguments[0]);"
        "return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data).filter((v, i) => i % 4 < 3)", canvas)


def png(browser, path):
    """The same of a PNG, as the browser reads it."""
    with open(path, "rb") as file:
        data = list(file.read())
    return browser.execute_async_script(
        "var done = arguments[1], blob = new Blob([new Uint8Array(arguments[0])], {type: 'image/png'});"
        "createImageBitmap(blob).then(b => { var c = document.createElement('canvas'); c.width = b.width; c.height = b.height;"
        "var d = c.getContext('2d'); d.drawImage(b, 0, 0);"
        "done(Array.from(d.getImageData(0, 0, b.width, b.height).data).filter((v, i) => i % 4 < 3)) })", data)


def choose(browser, identity, value):
    browser.execute_script("document.getElementById('stage').dataset.left = 'asked'")
    Select(browser.find_element(By.ID, identity)).select_by_value(value)
    whole(browser)


def saved(browser, button, name):
    path = os.path.join(WORK, name)
    if os.path.exists(path):
        os.remove(path)
    browser.find_element(By.ID, button).click()
    end = time.time() + 40
    while not os.path.exists(path) and time.time() < end:
        time.sleep(0.05)
    check(os.path.exists(path), f"{name} was not saved")
    time.sleep(0.1)
    with open(path, "rb") as file:
        return file.read()


def same_as_command(browser, what):
    """Canvas, PNG and EXR are those of the command that the page names."""
    browser.execute_script("document.getElementById('command').hidden = true")
    browser.find_element(By.ID, "save-command").click()
    until(browser, "return !document.getElementById('command').hidden", "the command")
    command = browser.find_element(By.ID, "command").text
    exr, picture = saved(browser, "save-exr", "golden.exr"), saved(browser, "save-png", "golden.png")
    os.makedirs(os.path.join(WORK, "again"), exist_ok=True)
    environment = dict(os.environ, PATH=os.path.abspath(os.path.join(BUILD, "bin")) + ":" + os.environ["PATH"])
    subprocess.run(command, shell=True, cwd=os.path.join(WORK, "again"), env=environment, check=True, capture_output=True)
    for name, data in (("golden.exr", exr), ("golden.png", picture)):
        with open(os.path.join(WORK, "again", name), "rb") as file:
            check(file.read() == data, f"{what}: {name} is not sim_render's: {command}")
    check(pixels(browser, "left") == png(browser, os.path.join(WORK, "again", "golden.png")),
          f"{what}: the canvas is not sim_render's picture: {command}")


def orbit(browser):
    stage = browser.find_element(By.ID, "stage")
    before = pixels(browser, "left")
    browser.execute_script("document.getElementById('stage').dataset.left = 'asked'")
    ActionChains(browser).move_to_element(stage).click_and_hold().move_by_offset(60, 25).move_by_offset(30, 5).release().perform()
    whole(browser)
    check(browser.find_element(By.ID, "view-name").text == "free camera", "a turned camera is no view's")
    check(pixels(browser, "left") != before, "turning changes nothing")
    before = pixels(browser, "left")
    for keys in ((Keys.ARROW_LEFT,), ("+",), (Keys.SHIFT, Keys.ARROW_UP)):
        browser.execute_script("document.getElementById('stage').dataset.left = 'asked'")
        stage.send_keys(*keys)
        whole(browser)
        after = pixels(browser, "left")
        check(after != before, f"{keys} does nothing")
        before = after


def fingers(browser, start, end):
    """Fingers that touch the picture at `start`, [(x, y)] from its middle, and go to `end`. Returns how far the camera was
    from what it looks at, before and after, and how far that moved."""
    state = "var c = View.viewer.camera(); return [c.distance, ...c.target()]"
    middle = browser.execute_script("var b = document.getElementById('stage').getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]")
    before = browser.execute_script(state)
    if start != end:
        browser.execute_script("document.getElementById('stage').dataset.left = 'asked'")
    for share in (0, 0.25, 0.5, 0.75, 1):
        points = [{"x": round(middle[0] + a[0] + share * (b[0] - a[0])), "y": round(middle[1] + a[1] + share * (b[1] - a[1])), "id": i}
                  for i, (a, b) in enumerate(zip(start, end))]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchMove" if share else "touchStart", "touchPoints": points})
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    whole(browser)
    after = browser.execute_script(state)
    return before[0], after[0], sum((a - b) ** 2 for a, b in zip(before[1:], after[1:])) ** 0.5


def touch(browser):
    before = pixels(browser, "left")
    distance, after, moved = fingers(browser, [(-40, 0)], [(40, 20)])
    check(abs(after / distance - 1) < 1e-6 and moved < 1e-6 * distance, "one finger does more than turn the camera")
    check(pixels(browser, "left") != before, "one finger does not turn the camera")
    distance, after, _ = fingers(browser, [(-40, 0), (40, 0)], [(-80, 0), (80, 0)])
    check(abs(after / distance - 0.5) < 0.01, f"fingers twice as far apart: {after / distance} times as far away, not half")
    distance, after, moved = fingers(browser, [(-40, 0), (40, 0)], [(-10, 20), (70, 20)])
    check(abs(after / distance - 1) < 0.01 and moved > 0.01 * distance, "two fingers do not shift the camera")
    title = browser.find_element(By.ID, "story-title").text
    fingers(browser, [(30, 30)], [(30, 30)])
    until(browser, f"return document.getElementById('story-title').textContent !== '{title}'", "the story of a pixel that was tapped")


def story(browser):
    ActionChains(browser).move_to_element(browser.find_element(By.ID, "stage")).click().perform()
    until(browser, "return !document.getElementById('story').hidden", "the story")
    lead = browser.find_element(By.ID, "story-lead").text
    rgb = [int(v) for v in lead.split("has them: ")[1].split(" of")[0].split(", ")]
    at = [int(v) for v in browser.find_element(By.ID, "story-title").text.split("Pixel ")[1].split(", ")]
    shown = pixels(browser, "left")[3 * (at[1] * SIZE + at[0]):][:3]
    check([(v * 255 + 32767) // 65535 for v in rgb] == shown, f"the story of {at} tells of {rgb}, the picture has {shown}")
    raster = until(browser, "return document.querySelector('#raster-C1 img')", "a raster")
    browser.execute_script("arguments[0].scrollIntoView()", raster)
    ActionChains(browser).move_to_element_with_offset(raster, 5, 9).click().perform()
    until(browser, "return document.querySelector('#svg-neuron title').textContent.includes('of C1')", "a neuron")
    replay = saved(browser, "story-replay", "sf_cosim-replay.json")
    check(len(json.loads(replay)["samples"]) > 0, "the replay has no samples")
    out = program("sf_cosim", "--replay", "sf_cosim-replay.json", "--evidence", "again/replayed").stdout.decode()
    check("no difference" in out, f"sf_cosim on the replay: {out}")


def maps(browser):
    for option in [o.get_attribute("value") for o in Select(browser.find_element(By.ID, "left-map")).options]:
        if option in ("none", "rtl-difference"):
            continue
        choose(browser, "left-map", option)
        check(browser.find_elements(By.CSS_SELECTOR, "#legend-left svg"), f"map {option} has no legend")
    choose(browser, "left-map", "rtl-difference")
    low, high = browser.execute_script("var v = [...document.getElementById('svg-map-scale').querySelectorAll('text')];"
                                       "return [v[0].textContent, v[v.length - 1].textContent]")
    check(low == "0" and high == "1 / 255", f"core and accelerator differ: {low} to {high}")
    choose(browser, "left-map", "none")


def pair(browser):
    browser.find_element(By.ID, "pair").click()
    whole(browser, "right")
    browser.execute_script("document.getElementById('stage').dataset.right = 'asked'")
    Select(browser.find_element(By.ID, "right-source")).select_by_value("float")
    whole(browser, "right")
    check(pixels(browser, "right") != pixels(browser, "left"), "the float picture is the fixed one")
    program("sim_render", "trained.snn", "set", "--backend", "float", "-o", "f.exr", "--png", "f.png")
    check(pixels(browser, "right") == png(browser, os.path.join(WORK, "f.png")), "the float picture is not sim_render's")


def fits(browser, name):
    wide, window = browser.execute_script("return [document.documentElement.scrollWidth, innerWidth]")
    check(wide <= window, f"{name}: the page is {wide} wide")
    with open(os.path.join(SHOTS, name + ".png"), "wb") as file:
        file.write(browser.get_screenshot_as_png())


def quiet(browser):
    said = [entry["message"] for entry in browser.get_log("browser")]
    check(not said, f"the console says: {said}")
    browser.get("about:blank")  # asks nothing of a program that ends


def scene_page(browser):
    with Served("sf_view", "trained.snn", "set", "--model", "model.safetensors", "--no-browser") as page:
        look(browser, 1280, 1000, False)
        browser.get(page.url)
        whole(browser)
        check(len(browser.page_source) < 200000, "the page is larger than 200 KB")
        same_as_command(browser, "view 0")
        story(browser)
        maps(browser)
        browser.execute_script("View.viewer.go(0)")
        pair(browser)
        for name, width, dark in (("light", 1280, False), ("dark", 1280, True), ("narrow", 390, False)):
            look(browser, width, 2600, dark)
            fits(browser, name)
        look(browser, 1280, 1000, False)
        browser.find_element(By.ID, "pair").click()
        orbit(browser)
        same_as_command(browser, "a free camera")
        touch(browser)
        quiet(browser)


def difference_page(browser):
    """The difference that a planted fault made: evidence.json, of scene.snn and data/."""
    with open(os.path.join(WORK, "evidence.json"), encoding="utf-8") as file:
        told = json.load(file)["difference"]
    with Served("sf_view", "--replay", "evidence.json", "--no-browser") as page:
        look(browser, 1280, 1600, False)
        browser.get(page.url)
        until(browser, "return document.getElementById('svg-difference')", "the difference")
        until(browser, "return !document.getElementById('story').hidden", "the story of its pixel")
        words = browser.find_element(By.ID, "difference").text
        for word in (told["in_the_run"], str(told["expected"]), str(told["actual"]), "layer C2", "neuron 37", "gtkwave",
                     "on the same samples: no difference"):
            check(word in words, f"the difference's story lacks '{word}': {words}")
        title = browser.find_element(By.ID, "story-title").text
        check(title == f"Pixel {told['x']}, {told['y']}", f"the story is of {title}")
        signals = saved(browser, "difference-signals", "difference.gtkw").decode()
        check("u_c2" in signals and "clk_i" in signals and told["wave"] in signals, f"the signals: {signals[:400]}")
        fits(browser, "difference")
        quiet(browser)


def training_page(browser):
    with Served("sf_train", "set", "-o", "watched.safetensors", "--minutes", "3", "--samples", "2048", "--levels", "6",
                "--log2-hash", "12", "--finest-res", "64", "--lattice", "128", "--quiet", "--view", "0", stream="stderr") as page:
        look(browser, 1280, 900, False)
        browser.get(page.url)
        until(browser, "return document.querySelectorAll('#svg-curves path').length >= 6", "the curves")
        until(browser, "return document.getElementById('preview').naturalWidth === 48", "the preview")
        until(browser, "return /PSNR/.test(document.getElementById('preview-psnr').textContent)", "its PSNR")
        for name, width in (("training", 1280), ("training-narrow", 390)):
            look(browser, width, 1400, False)
            fits(browser, name)
        quiet(browser)


def main():
    browser = open_browser()
    try:
        training_page(browser)
        difference_page(browser)
        scene_page(browser)
    finally:
        browser.quit()


main()
