/* The texts of the page, inside the program: it needs no file beside it. */
#include "page/internal.h"

/* A file of this folder, from the root of the repository, and a 0 behind it. */
#define TEXT(name, file)                                                                                               \
  __asm__(".pushsection .rodata\n"                                                                                     \
          ".global " #name "\n"                                                                                        \
          ".hidden " #name "\n" #name ": .incbin \"src/page/" file "\"\n"                                              \
          ".byte 0\n"                                                                                                  \
          ".popsection")

TEXT(html_report, "report.html");
TEXT(html_report_prices, "report_prices.html");
TEXT(html_report_proof, "report_proof.html");
TEXT(html_style, "report.css");
TEXT(html_script, "report.js");
