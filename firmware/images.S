# Empty images, overridden by a loader or by stronger symbols at link time: no net, no packets.
  .section .rodata
  .balign 4
  .weak sf_net_image
  .weak sf_net_image_size
  .weak sf_packets
sf_net_image:
  .word 0
sf_net_image_size:
  .word 0
sf_packets:
  .word 0, 0
