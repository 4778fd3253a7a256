"""Light files of this and other programs: .lp, DiLiGenT's tables, .dome, .mat, JSON."""
