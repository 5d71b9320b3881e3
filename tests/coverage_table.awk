#!/usr/bin/awk -f
# Table of line, branch and toggle coverage by file of a Verilator coverage file; fails under 95 % of the lines or of the
# branches. A line is covered where any of its points was hit; a branch is one side of an if. A point that stands several times in the design counts once: hit where any instance hit it.
BEGIN { FS = "\001" }
/^C / {
  kind = place = ""
  split("", field)
  for (i = 2; i <= NF; i++) { split($i, part, "\002"); field[part[1]] = substr($i, length(part[1]) + 2) }
  kind = field["page"] ~ /^v_line|^v_branch/ ? "line" : field["page"] ~ /^v_toggle/ ? "toggle" : ""
  if (kind == "") next
  count = $NF; sub(/.*' /, "", count)
  file = field["f"]
  if (kind == "line") {
    # S: the lines that the block covers, as "3-5,8"
    n = split(field["S"] == "" ? field["l"] : field["S"], range, ",")
    for (i = 1; i <= n; i++) {
      m = split(range[i], ends, "-")
      for (l = ends[1] + 0; l <= ends[m] + 0; l++) note("line", file, file ":" l, count)
    }
    if (field["page"] ~ /^v_branch/) note("branch", file, file ":" field["l"] ":" field["n"] " " field["o"], count)
  } else note("toggle", file, file ":" field["l"] ":" field["o"], count)
}
function note(kind, file, key, count) {
  files[file] = 1
  if (!((kind, key) in seen)) { seen[kind, key] = 0; all[kind, file]++; total[kind]++ }
  if (count + 0 > 0 && !seen[kind, key]) { seen[kind, key] = 1; hit[kind, file]++; sum[kind]++ }
}
function percent(part, whole) { return whole ? sprintf("%6.1f %%", 100 * part / whole) : "       -" }
function row(name, file) {
  return sprintf("%-28s %s %s %s", name, cell("line", file), cell("branch", file), cell("toggle", file))
}
function cell(kind, file) {
  return sprintf("%6d /%6d %s", file == "" ? sum[kind] : hit[kind, file], file == "" ? total[kind] : all[kind, file],
    file == "" ? percent(sum[kind], total[kind]) : percent(hit[kind, file], all[kind, file]))
}
END {
  printf "%-28s %23s %23s %23s\n", "file", "lines", "branches", "toggled bits"
  for (f in files) print row(f, f) | "sort"
  close("sort")
  print row("all", "")
  for (key in seen) {
    split(key, part, SUBSEP)
    if (part[1] != "toggle" && !seen[key]) print "  not covered: " part[1] " " part[2] | "sort"
  }
  close("sort")
  if (sum["line"] < 0.95 * total["line"] || sum["branch"] < 0.95 * total["branch"]) exit 1
}
