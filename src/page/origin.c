/* What must be known to repeat the audit, and the page's own stylesheet and script. */
#include "page/internal.h"
#include "base/sha256.h"
#include "spikefield/spikefield.h"
#include <string.h>

static void row(FILE *out, const char *name, const char *value)
{
  fprintf(out, "<tr><th>%s</th><td><code>", name);
  sf_xml_escape(out, value);
  fprintf(out, "</code></td></tr>\n");
}

/* A file that went since the audit has no row. */
static void hash_row(FILE *out, const char *name, const char *path)
{
  char hex[65];
  if (sf_sha256_file(path, hex).code == SF_OK) row(out, name, hex);
}

void html_origin(FILE *out, const sf_page *page)
{
  const sf_audit_report *r = page->report;
  char text[64];
  fprintf(out, "<section id=\"origin\">\n<h2>To repeat it</h2>\n<pre id=\"command\">");
  sf_xml_escape(out, page->command);
  if (page->model_sha256[0] && !strstr(page->command, "--model ") && !strstr(page->command, "--model=")) {
    fprintf(out, " --model ");
    sf_xml_escape(out, page->model);
  }
  fprintf(out, "</pre>\n<div class=\"scroll\"><table><tbody>\n");
  row(out, "spikefield", SPIKEFIELD_VERSION);
  row(out, "scene", html_base_name(r->scene));
  row(out, "scene SHA-256", r->sha256);
  if (page->model_sha256[0])
    row(out, "float model", html_base_name(page->model)), row(out, "model SHA-256", page->model_sha256);
  row(out, "data", html_base_name(r->data));
  hash_row(out, "data listing SHA-256", page->data->list);
  row(out, "split, view", page->view->name);
  row(out, "technology", html_base_name(r->ledgers.technology.path));
  hash_row(out, "technology SHA-256", r->ledgers.technology.path);
  snprintf(text, sizeof text, "%llu", (unsigned long long)r->seed);
  row(out, "seed of the random choices", text);
  fprintf(out, "</tbody></table></div>\n<p class=\"note\">Same inputs, same seed: the same counts and energies, to the "
               "last femtojoule, on "
               "any machine and with any number of threads. The whole report is inside this page as JSON (element "
               "<code>audit-json</code>).</p>\n</section>\n");
}

const char *const html_style[] = {
    ":root{--bg:#fff;--ink:#1c2127;--mut:#5b6470;--line:#c9ced6;--soft:#f3f5f7;--plate:#d5d9de;--good:#00664b;",
    "--bad:#a8321a;--spk:#0072b2;--link:#0067a3;--ann:#8a919b;--loss:#c24e00;--in:#fff;--dark:#1c2127;",
    "--l0:#0072b2;--l1:#6bbcec;--l2:#b84a00;--l3:#eba63c;--l4:#c98bb0;",
    "--p0:#b84a00;--p1:#0072b2;--p2:#009e73;--p3:#6bbcec;--p4:#eba63c;--p5:#a9b0b9;--p6:#c98bb0;--p7:#e3d34a}",
    "@media (prefers-color-scheme:dark){:root{--bg:#14171b;--ink:#e7eaee;--mut:#a0a9b4;--line:#454c56;--soft:#1e2329;",
    "--plate:#59616b;--good:#4cc9a0;--bad:#ff9478;--spk:#4aa8e0;--link:#6cbcec;--ann:#8a919b;--loss:#f08a45;--in:#"
    "0d1013;--dark:#0d1013;",
    "--l0:#3f9bd6;--l1:#93d0f5;--l2:#e8792e;--l3:#f3bb5e;--l4:#dba3c6;",
    "--p0:#e8792e;--p1:#3f9bd6;--p2:#2bb98d;--p3:#93d0f5;--p4:#f3bb5e;--p5:#9aa2ac;--p6:#dba3c6;--p7:#e9dc62}}",
    "*{box-sizing:border-box}", "html{-webkit-text-size-adjust:100%;color-scheme:light dark}",
    "body{margin:0 auto;max-width:1120px;padding:28px 20px 60px;background:var(--bg);color:var(--ink);",
    "font:16px/1.55 system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;font-variant-numeric:tabular-nums}",
    "h1{font-size:2rem;line-height:1.15;margin:.1em 0 .15em;letter-spacing:-.01em;overflow-wrap:anywhere}",
    "h2{font-size:1.35rem;line-height:1.25;margin:2.6rem 0 .5rem;padding-top:1rem;border-top:1px solid var(--line)}",
    "h3{font-size:1rem;margin:.8rem 0 .3rem}",
    "p,ul{max-width:72ch;margin:.5rem 0}ul{padding-left:1.2rem}li{margin:.3rem 0}",
    ".kicker{margin:0;color:var(--mut);font-size:.9rem}.sub{color:var(--mut);margin:0 0 1rem}",
    ".lead{font-size:1.25rem;line-height:1.45;max-width:60ch}.note{color:var(--mut);font-size:.9rem}",
    "a{color:var(--link)}code,pre{font:.86em/1.5 ui-monospace,'DejaVu Sans "
    "Mono',monospace}code{overflow-wrap:anywhere}",
    "pre{background:var(--soft);padding:.8rem 1rem;white-space:pre-wrap;overflow-wrap:anywhere;border-radius:6px}",
    ".facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:1px;background:var(--line);",
    "border:1px solid var(--line);border-radius:8px;overflow:hidden;margin:1.2rem 0 0}",
    ".facts div{background:var(--bg);padding:.6rem .9rem}.facts dt{color:var(--mut);font-size:.82rem}",
    ".facts dd{margin:0;font-size:1.25rem;font-weight:600;white-space:nowrap}",
    ".facts small{display:block;font-weight:400;font-size:.8rem;color:var(--mut)}data{white-space:nowrap}",
    ".facts .unit{display:inline}.facts .basis{white-space:normal;line-height:1.3}",
    "#glossary{display:grid;grid-template-columns:max-content minmax(0,1fr);gap:.15rem "
    "1rem;font-size:.9rem;max-width:84ch}",
    "#glossary dt{font-weight:600}#glossary dd{margin:0}", "@media (max-width:520px){#glossary{display:block}}",
    "nav{margin:1rem 0 0;font-size:.92rem}nav a{margin-right:1rem;white-space:nowrap}",
    ".grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr));gap:1.6rem "
    "2rem;align-items:start;",
    "margin-top:1.2rem}",
    "figure{margin:1.2rem 0 0;min-width:0}.grid figure{margin:0}figcaption{font-size:.92rem;line-height:1.45;margin:0 "
    "0 .6rem;",
    "color:var(--mut);max-width:76ch}figcaption b{color:var(--ink)}",
    ".pictures figure{display:grid;grid-template-rows:subgrid;grid-row:span 3;row-gap:0}",
    ".split{display:grid;grid-template-columns:minmax(0,1.9fr) minmax(0,1fr);gap:.2rem 2rem;align-items:start}",
    ".split figcaption{grid-column:1/-1}@media (max-width:760px){.split{grid-template-columns:minmax(0,1fr)}}",
    ".pair,.trio{display:grid;gap:1rem 2rem}.pair{grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr))}",
    ".trio{grid-template-columns:repeat(auto-fit,minmax(min(100%,300px),1fr))}.trio "
    "figcaption{grid-column:1/-1;margin:0}",
    "svg{display:block;width:100%;height:auto;overflow:visible}",
    "svg text{font:13px system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;fill:var(--ink);",
    "font-variant-numeric:tabular-nums}",
    "svg .lab,svg .strong{font-weight:600}svg .head{font-size:15px;font-weight:600}svg .mut{fill:var(--mut)}",
    "svg .end{text-anchor:end}svg .mid{text-anchor:middle}svg .in{fill:var(--in);font-size:12px;pointer-events:none}",
    "svg .dark{fill:var(--dark)}svg .part{fill:var(--dark);font-size:11.5px;pointer-events:none}",
    "svg .good{fill:var(--good)}svg .bad{fill:var(--bad)}.good{color:var(--good)}.bad{color:var(--bad)}",
    ".ax{stroke:var(--mut);stroke-width:1}.gridline{stroke:var(--line);stroke-width:1}",
    ".mark{stroke:var(--ink);stroke-width:2}.gain{stroke:var(--spk);stroke-width:6;stroke-linecap:round;opacity:.35}",
    ".twin{stroke:var(--ann);stroke-width:2;stroke-dasharray:5 4}.ink{stroke:var(--ink);stroke-width:1.3}",
    ".inkfill{fill:var(--ink)}.even{fill:var(--ink)}.curve{fill:none;stroke:var(--spk);stroke-width:2}",
    ".dot{fill:var(--spk);stroke:var(--bg);stroke-width:1.5}.chosen.dot{fill:var(--loss)}",
    ".halo,.ring{fill:none;stroke:#000;stroke-width:4;vector-effect:non-scaling-stroke;opacity:.55}",
    ".ring{stroke:#fff;stroke-width:2;opacity:1}.box{fill:var(--soft);stroke-width:1.5}.box.ann{stroke:var(--ann)}",
    ".box.spk{stroke:var(--spk)}.box.none{stroke:var(--line);stroke-dasharray:4 3}.field{fill:var(--soft)}",
    ".tick{fill:none;stroke-width:1.5}.bar.spk{fill:var(--spk)}.bar.loss{fill:var(--loss)}",
    ".bar.cheap,.key.cheap{fill:#8f72c9;background:#8f72c9}.bar.dear,.key.dear{fill:#8b8530;background:#8b8530}",
    ".l0{fill:var(--l0)}.l1{fill:var(--l1)}.l2{fill:var(--l2)}.l3{fill:var(--l3)}.l4{fill:var(--l4)}",
    "path.l0{stroke:var(--l0);fill:none}path.l2{stroke:var(--l2);fill:none}path.l3{stroke:var(--l3);fill:none}",
    ".p0{fill:var(--p0)}.p1{fill:var(--p1)}.p2{fill:var(--p2)}.p3{fill:var(--p3)}",
    ".p4{fill:var(--p4)}.p5{fill:var(--p5)}.p6{fill:var(--p6)}.p7{fill:var(--p7)}",
    ".key{display:inline-block;width:.7em;height:.7em;border-radius:2px;margin-right:.4em}",
    ".key.l0{background:var(--l0)}.key.l1{background:var(--l1)}.key.l2{background:var(--l2)}.key.l3{background:var(--"
    "l3)}",
    ".key.l4{background:var(--l4)}.key.p0{background:var(--p0)}.key.p1{background:var(--p1)}.key.p2{background:var(--"
    "p2)}",
    ".key.p3{background:var(--p3)}.key.p4{background:var(--p4)}.key.p5{background:var(--p5)}",
    ".key.p6{background:var(--p6)}.key.p7{background:var(--p7)}",
    ".plate{position:relative;background:var(--plate);line-height:0}.plate img{width:100%;height:auto;display:block}",
    "img.coarse{image-rendering:pixelated}.plate svg.over{position:absolute;inset:0;height:100%}",
    /* a shadow at the side on which there is more */
    ".scroll{overflow-x:auto;margin:1rem 0;background:linear-gradient(90deg,var(--bg) 40%,transparent) left/36px 100% "
    "no-repeat local,",
    "linear-gradient(270deg,var(--bg) 40%,transparent) right/36px 100% no-repeat local,",
    "linear-gradient(90deg,var(--ann),transparent) left/14px 100% no-repeat scroll,",
    "linear-gradient(270deg,var(--ann),transparent) right/14px 100% no-repeat "
    "scroll}table{border-collapse:collapse;font-size:.88rem;line-height:1.35;width:100%}",
    "#table-units "
    "td:last-child{min-width:22em}table.narrow{width:auto}caption{text-align:left;font-weight:600;padding-bottom:."
    "4rem}",
    "th,td{text-align:left;padding:.32rem .9rem .32rem 0;border-bottom:1px solid var(--line);vertical-align:top}",
    "thead th{color:var(--mut);font-weight:500;vertical-align:bottom}tbody th{font-weight:600;white-space:nowrap}",
    ".n{text-align:right}td.n{white-space:nowrap}td.strong{font-weight:600}td.mut{color:var(--mut)}",
    "@media (max-width:520px){svg text,svg .in,svg .part{font-size:15.5px}.trio svg text{font-size:13px}}",
    "tr.chosen{background:var(--soft)}", "body[data-layer] svg .bar:not(.lit){opacity:.25}",
    "@media print{:root{--bg:#fff;--ink:#000;--mut:#444;--line:#bbb;--soft:#f3f5f7;--plate:#d5d9de;--good:#00664b;",
    "--bad:#a8321a;--spk:#0072b2;--ann:#8a919b;--loss:#c24e00;--in:#fff;--dark:#1c2127;--l0:#0072b2;--l1:#6bbcec;",
    "--l2:#b84a00;--l3:#eba63c;--l4:#c98bb0;--p0:#b84a00;--p1:#0072b2;--p2:#009e73;--p3:#6bbcec;--p4:#eba63c;--p5:#"
    "a9b0b9;",
    "--p6:#c98bb0;--p7:#e3d34a}html{color-scheme:light}body{max-width:none;padding:0;font-size:11pt;",
    "print-color-adjust:exact;-webkit-print-color-adjust:exact}figure,tr,.facts{break-inside:avoid}",
    "h2,h3,figcaption,caption{break-after:avoid}table{font-size:8pt}",
    "th,td{padding-right:.5rem}a{color:inherit;text-decoration:none}}",
    "@media print and (min-width:680px){.scroll{overflow:visible}}", NULL};

/* A pointer on a layer's bar shows the same layer everywhere. */
const char *const html_script[] = {
    "(function(){",
    "var bars=Array.prototype.slice.call(document.querySelectorAll('svg .bar'));",
    "function layer(e){var m=/ l[0-4]( |$)/.exec(e.getAttribute('class'));return m?m[0].trim():null}",
    "function show(name){",
    "if(name){document.body.setAttribute('data-layer',name)}else{document.body.removeAttribute('data-layer')}",
    "bars.forEach(function(b){b.classList.toggle('lit',!name||layer(b)===name||!layer(b))})}",
    "bars.forEach(function(b){var name=layer(b);if(!name){return}",
    "b.addEventListener('pointerenter',function(){show(name)});",
    "b.addEventListener('pointerleave',function(){show(null)})});",
    "})();",
    NULL};
