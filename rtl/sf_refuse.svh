// SF_REFUSE(condition, "why"): a build with impossible parameters ends with an error that names the parameter, when it is
// elaborated; in Icarus 11, which has no such errors, when the simulation starts.
`ifdef __ICARUS__
`define SF_REFUSE(condition, why) initial if (condition) $fatal(1, why);
`else
`define SF_REFUSE(condition, why) generate if (condition) $error(why); endgenerate
`endif
