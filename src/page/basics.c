/* What is counted, for somebody who has read nothing else; the layers of the network. */
#include "page/internal.h"

static void box(FILE *out, double x, double y, double width, const char *style, const char *text)
{
  fprintf(out, "<rect x=\"%g\" y=\"%g\" width=\"%g\" height=\"34\" rx=\"5\" class=\"%s\"/>\n", x, y, width, style);
  svg_text(out, x + width / 2, y + 22, "mid", "%s", text);
}

static void arrow(FILE *out, double x1, double x2, double y)
{
  svg_line(out, x1, y, x2 - 5, y, "ink");
  fprintf(out, "<path d=\"M%g %gl-7 -4v8z\" class=\"inkfill\"/>\n", x2, y);
}

static void mac_picture(FILE *out)
{
  svg_begin(out, "svg-mac", 480, 136, "One MAC", "A value is multiplied by a weight and the product added to a sum.");
  svg_text(out, 0, 16, "head", "MAC: multiply, then add");
  box(out, 0, 52, 96, "box ann", "value 0.37");
  arrow(out, 96, 136, 69);
  box(out, 136, 52, 116, "box ann",
      "\xc3\x97 weight \xe2\x88\x92"
      "12");
  arrow(out, 252, 292, 69);
  box(out, 292, 52, 188, "box ann", "sum \xe2\x88\x92 4.44");
  svg_text(out, 0, 130, "mut", "for every input, whatever its value: 4.6 pJ");
  svg_end(out);
}

static void sop_picture(FILE *out)
{
  svg_begin(out, "svg-sop", 480, 136, "One SOP", "A spike adds its weight to a sum; without a spike nothing happens.");
  svg_text(out, 0, 16, "head", "SOP: add, and only where a spike arrives");
  box(out, 0, 30, 96, "box spk", "spike");
  arrow(out, 96, 292, 47);
  box(out, 292, 30, 188, "box spk", "sum \xe2\x88\x92 12");
  box(out, 0, 72, 96, "box none", "no spike");
  svg_text(out, 112, 94, "mut", "nothing happens, nothing is counted");
  svg_text(out, 0, 130, "mut", "for every spike and every neuron it reaches: 0.9 pJ");
  svg_end(out);
}

typedef struct layer_text {
  const char *role, *priced;
} layer_text;

static const layer_text layers[SF_LAYERS] = {
    [FX_D1] = {"reads the features of the sample\xe2\x80\x99s position", "MAC, once per sample"},
    [FX_D2] = {"turns spikes into density, and into h, the input of C1", "SOP, at every step"},
    [FX_C1] = {"reads the direction of the ray and h", "MAC: direction once per ray, h at every step"},
    [FX_C2] = {"spikes in, spikes out", "SOP, at every step"},
    [FX_C3] = {"turns spikes into red, green and blue", "SOP, at every step"},
};

/* A decoder alone, behind a field without a network. */
static const layer_text decoder[SF_LAYERS] = {
    [FX_C1] = {"reads the appearance of the sample and the direction", "MAC, once per sample"},
    [FX_C2] = {"spikes in, spikes out", "SOP, at every step"},
    [FX_C3] = {"turns spikes into red, green and blue", "SOP, at every step"},
};

static void layer_table(FILE *out, const sf_page *page)
{
  const fx_net *net = page->report->net;
  const layer_text *text = fx_net_first_layer(net) == FX_D1 ? layers : decoder;
  fprintf(out, "<div class=\"scroll\"><table><caption>The layers of this network</caption>\n<thead><tr><th>layer</th>"
               "<th>what it does</th><th class=\"n\">inputs</th><th class=\"n\">outputs</th><th>counted as</th></tr>"
               "</thead>\n<tbody>\n");
  for (int l = 0; l < SF_LAYERS; l++) {
    if (net->layer[l].n_out == 0) continue;
    fprintf(out,
            "<tr><th><i class=\"key l%d\"></i>%s</th><td>%s</td><td class=\"n\"><data data-key=\"counts.layers[%d]"
            ".n_in\" value=\"%d\">%d</data></td><td class=\"n\">%d</td><td>%s</td></tr>\n",
            l, fx_layer_name(l), text[l].role, l, net->layer[l].n_in, net->layer[l].n_in, net->layer[l].n_out,
            text[l].priced);
  }
  fprintf(out, "</tbody></table></div>\n");
}

/* Words of the page that only some of its readers know. */
static void glossary(FILE *out)
{
  static const char *const word[][2] = {
      {"field bytes", "reads of the table that holds the scene: the hash grid, or planes and lines"},
      {"state bytes", "reads and writes of membranes: what a neuron keeps between steps; in the twin, of activations"},
      {"frame bytes", "finished pixels, written to memory"},
      {"h", "what the density network hands to the colour network, at every step"},
      {"t_r, T", "time steps that the network runs after its training; the most that the training allowed"},
      {"SSIM", "likeness of two pictures in their structure; 1 is equal"},
      {"fixed-point core", "C code that computes with the integers of the accelerator, bit for bit"},
      {"golden image", "the picture that the fixed-point core renders: what hardware must reproduce"},
  };
  fprintf(out, "<h3>Words</h3>\n<dl id=\"glossary\">\n");
  for (size_t i = 0; i < sizeof word / sizeof *word; i++)
    fprintf(out, "<dt>%s</dt><dd>%s</dd>\n", word[i][0], word[i][1]);
  fprintf(out, "</dl>\n");
}

void html_basics(FILE *out, const sf_page *page)
{
  fprintf(out,
          "<section id=\"basics\">\n<h2>What is being counted</h2>\n"
          "<p>A radiance field is a small neural network that answers one question: how dense is the scene at this "
          "point, and what colour does it have seen from this direction? To draw a pixel, a line of sight (a "
          "<b>ray</b>) is followed into the scene and the network is asked at points along it (the <b>samples</b>). "
          "The work of a picture is the sum of these answers.</p>\n"
          "<p>An ordinary network answers with multiplications. A <b>spiking</b> network lets its neurons run for a "
          "few time steps; at each step a neuron either sends a pulse (a <b>spike</b>) or stays silent. A pulse has "
          "no value to multiply by, so the receiving neuron only adds a weight. The question of this audit: do "
          "these cheaper operations, over %d time step%s, add up to less?</p>\n"
          "<figure id=\"fig-basics\" class=\"pair\">\n",
          page->report->net->steps, page->report->net->steps == 1 ? "" : "s");
  mac_picture(out);
  sop_picture(out);
  fprintf(out, "</figure>\n<p>The prices are those of 32-bit floating-point arithmetic in a 45 nm chip, as the "
               "literature uses them. 1 pJ (picojoule) is 10<sup>\xe2\x88\x92"
               "12</sup> J; 1 mJ is a billion pJ.</p>\n");
  layer_table(out, page);
  glossary(out);
  fprintf(out, "</section>\n");
}
