/* Names of files and views in reports: any bytes come in, UTF-8 goes out. */
#ifndef SF_BASE_TEXT_H
#define SF_BASE_TEXT_H
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

extern const char sf_utf8_replacement[]; /* U+FFFD */
/* Bytes of the character that begins here; 0 where there is none that is well-formed and allowed in XML. */
size_t sf_utf8_length(const char *text);
void sf_utf8_write(FILE *out, const char *text);
void sf_xml_escape(FILE *out, const char *text); /* of an element or an attribute; control characters become '?' */
/* "s", but for one: 1 ray, 2 rays. */
const char *sf_plural(uint64_t count);
/* A field of CSV, quoted where it has to be (RFC 4180). */
void sf_csv_text(FILE *out, const char *text);
#endif
