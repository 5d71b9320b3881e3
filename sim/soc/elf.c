/* ELF32 into the memory of the system: the loadable segments, nothing else. */
#include "firmware/sf_soc.h"
#include "sim/soc/soc.h"
#include "base/io.h"
#include <elf.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { FILE_MAX = 16 << 20 };

static sf_status load_segment(sf_soc *soc, const char *path, const char *file, size_t size, const Elf32_Phdr *segment)
{
  const uint64_t end = (uint64_t)segment->p_paddr + segment->p_memsz;
  if (segment->p_offset > size || segment->p_filesz > size - segment->p_offset || segment->p_filesz > segment->p_memsz)
    return sf_fail(SF_E_FORMAT, "%s: the segment at offset %" PRIu32 " is cut short", path, segment->p_offset);
  uint8_t *to = sf_soc_memory(soc, segment->p_paddr, segment->p_memsz);
  if (!to || end > SF_SOC_IMAGE)
    return sf_fail(SF_E_RANGE, "%s: segment 0x%08" PRIx32 "..0x%08" PRIx64 " is outside 0x%08x..0x%08x", path,
                   segment->p_paddr, end, SF_SOC_RAM, SF_SOC_IMAGE);
  memset(to, 0, segment->p_memsz);
  memcpy(to, file + segment->p_offset, segment->p_filesz);
  return sf_ok();
}

static sf_status check_flags(const char *path, uint32_t flags)
{
  const char *what = flags & EF_RISCV_RVC         ? "built with compressed instructions"
                     : flags & EF_RISCV_FLOAT_ABI ? "built for floating-point registers"
                                                  : NULL;
  return what ? sf_fail(SF_E_UNSUPPORTED, "%s: %s: the system is RV32IM", path, what) : sf_ok();
}

static sf_status load(sf_soc *soc, const char *path, const char *file, size_t size)
{
  Elf32_Ehdr head;
  if (size < sizeof head || memcmp(file, ELFMAG, SELFMAG) != 0)
    return sf_fail(SF_E_FORMAT, "%s: not an ELF file", path);
  memcpy(&head, file, sizeof head);
  if (head.e_ident[EI_CLASS] != ELFCLASS32 || head.e_machine != EM_RISCV || head.e_type != ET_EXEC)
    return sf_fail(SF_E_UNSUPPORTED, "%s: not a 32-bit RISC-V program", path);
  SF_TRY(check_flags(path, head.e_flags));
  if (head.e_phentsize != sizeof(Elf32_Phdr) || head.e_phoff > size ||
      (size_t)head.e_phnum * sizeof(Elf32_Phdr) > size - head.e_phoff)
    return sf_fail(SF_E_FORMAT, "%s: the table of segments is cut short", path);
  for (int i = 0; i < head.e_phnum; i++) {
    Elf32_Phdr segment;
    memcpy(&segment, file + head.e_phoff + (size_t)i * sizeof segment, sizeof segment);
    if (segment.p_type == PT_LOAD) SF_TRY(load_segment(soc, path, file, size, &segment));
  }
  sf_soc_begin_at(soc, head.e_entry);
  return sf_ok();
}

sf_status sf_soc_load_elf(sf_soc *soc, const char *path)
{
  char *file;
  size_t size;
  SF_TRY(sf_read_file(path, FILE_MAX, &file, &size));
  const sf_status status = load(soc, path, file, size);
  free(file);
  return status;
}
