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
    paper, twin = report["ledgers"]["list"][0], report["ledgers"]["list"][5]
    assert paper["total_fj"] == report["energy_spiking_fj"] == report["ledger"]["spiking_fj"]
    assert twin["total_fj"] == report["energy_ann_fj"]
    check_accesses(report)
    for name, total in report["counts"]["total"].items():
        assert sum(sum(layer[name]) for layer in report["counts"]["layers"]) == total, name


def check_accesses(report):
    """What is read costs its accesses, in net and twin alike."""
    traffic, ledgers = report["counts"]["traffic"], {l["key"]: l for l in report["ledgers"]["list"]}
    units = ledgers["neuron"]["rows"][5]["unit_fj"]
    for key in ["memory", "neuron", "shared", "ann_int_memory", "ann_int_all", "ann_int_shared"]:
        parts = ledgers[key]["parts_fj"]
        assert parts["lookup"] == traffic["lookups"] * units["lookup"], key
        assert parts["fill"] == traffic["misses"] * units["fill"], key
    assert 0 < traffic["misses"] < traffic["lookups"]
    for net, twin in [("neuron", "ann_int_all"), ("shared", "ann_int_shared")]:
        for part in ["lookup", "fill", "frame", "product", "place"]:
            assert ledgers[net]["parts_fj"][part] == ledgers[twin]["parts_fj"][part], part
    for alone, shared in [("neuron", "shared"), ("ann_int_all", "ann_int_shared")]:
        less = ledgers[alone]["total_fj"] - ledgers[shared]["total_fj"]
        assert less == ledgers[alone]["parts_fj"]["weight"] - ledgers[shared]["parts_fj"]["weight"] > 0


def check_csv(report, path):
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5 * report["t_r"] + 2
    for ledger in report["ledgers"]["list"][:5]:
        assert sum(int(row[ledger["key"] + "_fj"]) for row in rows) == ledger["total_fj"], ledger["key"]
    for layer in report["counts"]["layers"]:
        for name in report["counts"]["total"]:
            mine = [int(row[name]) for row in rows if row["layer"] == layer["name"]]
            assert mine == layer[name], (layer["name"], name)
    traffic = report["counts"]["traffic"]
    for name in ["table_bytes", "frame_bytes", "lookups", "misses", "products", "places", "harmonics"]:
        assert sum(int(row[name]) for row in rows) == traffic[name], name
    assert int(rows[-1]["special"]) == traffic["exp_neg"]
    assert int(rows[-2]["special"]) == traffic["field_special"]


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

def as_scheme_1(report):
    """A report as before: memories by the byte, no cache, eight ledgers."""
    old = copy.deepcopy(report)
    old["format"] = "spikefield-audit-1"
    del old["cache"], old["shared"]
    old["ledgers"]["list"] = [l for l in old["ledgers"]["list"] if "shared" not in l["key"]]
    for ledger in old["ledgers"]["list"]:
        parts = ledger["parts_fj"]
        parts["table"] = parts.pop("lookup") + parts.pop("fill")
        del parts["product"], parts["place"]
    return old


with tempfile.TemporaryDirectory() as folder:
    for name, side in [("new", report), ("old", as_scheme_1(report))]:
        with open(f"{folder}/{name}.json", "w", encoding="utf-8") as file:
            json.dump(side, file)
    across = json.loads(output("--compare", f"{folder}/old.json", f"{folder}/new.json", "--json"))
    schema("energy_audit_compare").validate(across)
    assert {l["key"] for l in across["ledgers"]} == {"paper", "width", "ann_fp32", "ann_int"}
    refused = {l["key"]: l["why"] for l in across["not_comparable"]}
    assert set(refused) == {"memory", "neuron", "ann_int_memory", "ann_int_all", "shared", "ann_int_shared"}
    assert refused["shared"] == "A does not have it" and "by the byte" in refused["memory"]
    text = output("--compare", f"{folder}/old.json", f"{folder}/new.json")
    assert "not compared: everything (one report prices memories by the byte" in text
    both_old = json.loads(output("--compare", f"{folder}/old.json", f"{folder}/old.json", "--json"))
    assert len(both_old["ledgers"]) == 8 and not both_old["not_comparable"]

print("reports, tables and comparison agree with their schemas and with themselves")
