#!/bin/bash
# Gathers a study's tables once its tasks have ended: PROGRAM STUDY. Written by `light4gs study --launcher slurm`.
exec "$1" gather "$2"
