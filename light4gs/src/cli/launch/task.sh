#!/bin/bash
# One task as a job of an array: PROGRAM RESTARTS COMMAND FOLDER. Written by `light4gs ... --launcher slurm`.
program=$1 restarts=$2 command=$3 folder=$4

"$program" "$command" "$folder" "$SLURM_ARRAY_TASK_ID" --quiet &
task=$!
# Slurm sends it to this script alone.
trap 'kill -USR1 "$task" 2>/dev/null' USR1

interrupted=$((128 + $(kill -l USR1)))
wait "$task"
code=$?
# A signal that is trapped ends `wait` before the task has ended.
while [ "$code" -eq "$interrupted" ]; do
    wait "$task"
    code=$?
    [ "$code" -eq 127 ] && code=$interrupted && break
done

if [ "$code" -eq 75 ]; then
    echo "task $SLURM_ARRAY_TASK_ID stopped on request; it is queued again" >&2
    scontrol requeue "$SLURM_JOB_ID"
elif [ "$code" -gt 128 ]; then
    echo "task $SLURM_ARRAY_TASK_ID was killed by signal $((code - 128))" >&2
    if [ "${SLURM_RESTART_COUNT:-0}" -lt "$restarts" ]; then
        echo "it is queued again" >&2
        scontrol requeue "$SLURM_JOB_ID"
    else
        echo "killed by signal $((code - 128)), $restarts times queued again" >"$folder/.logs/task-$SLURM_ARRAY_TASK_ID.failed"
    fi
elif [ "$code" -ne 0 ] && [ ! -e "$folder/.logs/task-$SLURM_ARRAY_TASK_ID.failed" ]; then
    echo "exit code $code; see $folder/.logs/task-$SLURM_ARRAY_TASK_ID.log" >"$folder/.logs/task-$SLURM_ARRAY_TASK_ID.failed"
fi
exit "$code"
