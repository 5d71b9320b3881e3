"""What energy_audit writes: JSON against its schemas, CSV against JSON, sums against their terms.

usage: audit_schema.py ENERGY_AUDIT SCENE DATA; exit status 77 without python3-jsonschema
"""
import copy
import csv
import json
import subprocess
import sys
import tempfile

try:
    import jsonschema
except ImportError:
    print("python3-jsonschema is not installed")
    sys.exit(77)

program, scene, data = sys.argv[1:]


def output(*arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def schema(name):
    with open(f"share/schema/{name}.schema.json", encoding="utf-8") as file:
        text = json.load(file)
    jsonschema.Draft7Validator.check_schema(text)
    return jsonschema.Draft7Validator(text)


def check_sums(report):
    steps = report["t_r"]
    for ledger in report["ledgers"]["list"]:
        assert sum(ledger["parts_fj"].values()) == ledger["total_fj"], ledger["key"]
        assert sum(sum(row["fj"]) for row in ledger["rows"]) == ledger["total_fj"], ledger["key"]
        assert all(len(row["fj"]) == steps for row in ledger["rows"][:5])
    paper, twin = report["ledgers"]["list"][0], report["ledgers"]["list"][4]
    assert paper["total_fj"] == report["energy_spiking_fj"] == report["ledger"]["spiking_fj"]
    assert twin["total_fj"] == report["energy_ann_fj"]
    for name, total in report["counts"]["total"].items():
        assert sum(sum(layer[name]) for layer in report["counts"]["layers"]) == total, name


def check_csv(report, path):
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5 * report["t_r"] + 2
    for ledger in report["ledgers"]["list"][:4]:
        assert sum(int(row[ledger["key"] + "_fj"]) for row in rows) == ledger["total_fj"], ledger["key"]
    for layer in report["counts"]["layers"]:
        for name in report["counts"]["total"]:
            mine = [int(row[name]) for row in rows if row["layer"] == layer["name"]]
            assert mine == layer[name], (layer["name"], name)
    traffic = report["counts"]["traffic"]
    assert sum(int(row["table_bytes"]) for row in rows) == traffic["table_bytes"]
    assert sum(int(row["frame_bytes"]) for row in rows) == traffic["frame_bytes"]
    assert int(rows[-1]["special"]) == traffic["exp_neg"]


def refuses(validator, report, change):
    broken = copy.deepcopy(report)
    change(broken)
    assert not validator.is_valid(broken), "the schema lets a broken report pass"


with tempfile.NamedTemporaryFile(suffix=".csv") as table:
    options = ["--rays", "300", "--rtl-rays", "2", "--recount-rays", "20", "--quiet", "--json"]
    report = json.loads(output(scene, data, *options, "--csv", table.name))
    check_csv(report, table.name)
audit = schema("energy_audit")
audit.validate(report)
check_sums(report)
audit.validate(json.loads(output(scene, data, *options, "--published")))
with tempfile.NamedTemporaryFile(suffix=".html") as page:
    shown = json.loads(output(scene, data, "--view", "0", "--rtl-rays", "0", "--quiet", "--json", "--html", page.name))
audit.validate(shown)
assert set(audit.schema["properties"]["page"]["required"]) == set(shown["page"]), "the page's JSON has other members"
silent = json.loads(output(scene, data, *options, "--steps", "1", "--rtl-rays", "0"))
audit.validate(silent)
assert silent["core_equals_rtl_equals_recount"] is None

# The schema is strict enough to notice.
refuses(audit, report, lambda r: r.pop("ledgers"))
refuses(audit, report, lambda r: r["ledgers"]["list"].pop())
refuses(audit, report, lambda r: r["ledgers"]["list"][1].update(total_fj=1.5))
refuses(audit, report, lambda r: r["counts"]["layers"][0]["mac"].clear())
refuses(audit, report, lambda r: r["ledgers"]["technology"]["prices"][0].update(source=""))
refuses(audit, report, lambda r: r["ledgers"]["list"][0]["parts_fj"].update(extra=1))
refuses(audit, shown, lambda r: r["page"]["origin"].pop("command"))

comparison = json.loads(
    output("--compare", scene, scene, data, "--steps", "2", "--steps-b", "1", "--rays", "300", "--rtl-rays", "0",
           "--quiet", "--json"))
schema("energy_audit_compare").validate(comparison)
assert {"name": "t_r", "a": 2, "b": 1} in comparison["settings"]
for ledger in comparison["energies_mj_per_view"].values():
    for changes in ledger.values():
        sizes = [abs(change["change"]) for change in changes]
        assert sizes == sorted(sizes, reverse=True), "not largest first"
for ledger in comparison["ledgers"]:
    cells = comparison["energies_mj_per_view"][ledger["key"]]["cells"]
    change = ledger["b_mj_per_view"] - ledger["a_mj_per_view"]
    assert abs(sum(cell["change"] for cell in cells) - change) < 1e-9 * ledger["a_mj_per_view"], ledger["key"]
print("reports, tables and comparison agree with their schemas and with themselves")
