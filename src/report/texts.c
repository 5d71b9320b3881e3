/* The template of the page, inside the program. */
#include "report/internal.h"

/* From the root of the repository, and a 0 behind it. */
__asm__(".pushsection .rodata\n"
        ".global sf_report_page_text\n"
        ".hidden sf_report_page_text\n"
        "sf_report_page_text: .incbin \"src/report/reproduction.html\"\n"
        ".byte 0\n"
        ".popsection");
