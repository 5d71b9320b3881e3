# Makes the neuron of serial/sf_plif.sv round half away from 0, which differs only where a half is negative.
s/product = nodecay3_q == distance\[25\] ? HALF : HALF - 39'd1;/product = nodecay3_q \&\& !distance[25] ? HALF - 39'd1 : HALF;/
