# A Slurm of this host alone, as root and without systemd, for a test:   . slurm_here.bash FOLDER
# slurm_begin starts munged, slurmctld and slurmd in FOLDER; false where one does not start: its last words are printed.
# slurm_end ends them. Its commands find it by SLURM_CONF.
slurm_folder=$1 slurm_pids=()
slurm_config() {
  cat <<END
ClusterName=here
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$1
SlurmdPort=$2
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$slurm_folder/munge.socket
CredType=cred/munge
StateSaveLocation=$slurm_folder/state
SlurmdSpoolDir=$slurm_folder/spool
SlurmctldPidFile=$slurm_folder/slurmctld.pid
SlurmdPidFile=$slurm_folder/slurmd.pid
SlurmctldLogFile=$slurm_folder/slurmctld.log
SlurmdLogFile=$slurm_folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=1
MpiDefault=pmix
ReturnToService=2
SlurmdParameters=config_overrides
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=8 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:8
END
}
slurm_begin() {
  local port=$((20000 + $$ % 20000)) i
  mkdir -p "$slurm_folder"/{state,spool} && chmod 700 "$slurm_folder"
  head -c 1024 /dev/urandom >"$slurm_folder/munge.key" && chmod 600 "$slurm_folder/munge.key"
  export SLURM_CONF=$slurm_folder/slurm.conf
  slurm_config $port $((port + 1)) >"$SLURM_CONF"
  munged --foreground --force --socket="$slurm_folder/munge.socket" --key-file="$slurm_folder/munge.key" \
    --pid-file="$slurm_folder/munged.pid" --seed-file="$slurm_folder/munged.seed" --log-file="$slurm_folder/munged.log" >/dev/null 2>&1 &
  slurm_pids=($!)
  for ((i = 0; i < 50; i++)); do [ -S "$slurm_folder/munge.socket" ] && break; sleep 0.1; done
  slurmctld -D >/dev/null 2>&1 &
  slurm_pids+=($!)
  slurmd -D >/dev/null 2>&1 &
  slurm_pids+=($!)
  for ((i = 0; i < 100; i++)); do
    sinfo -h -o %t 2>/dev/null | grep -qx 'idle' && return 0
    sleep 0.2
  done
  tail -n 3 "$slurm_folder"/*.log
  return 1
}
slurm_end() {
  scancel --state=PENDING --user=root 2>/dev/null
  kill "${slurm_pids[@]}" 2>/dev/null
  wait "${slurm_pids[@]}" 2>/dev/null
}
