#!/bin/bash
# Puts together what tasks have made, once they have ended: PROGRAM COMMAND FOLDER. Written by `light4gs ... --launcher slurm`.
exec "$1" "$2" "$3"
