"""Words of Sinumerik programs in the middle of a contour, as :mod:`gcode_traps`."""

from __future__ import annotations

from functools import partial

import gcode_traps as t
from gcode_traps import EITHER, LAST, READ, REFUSED, SQUARE, START

trap, blocks, words = (partial(f, ending="mpf") for f in (t.trap, t.blocks, t.words))
block, body, second, word = (partial(f, ending="mpf") for f in (t.block, t.body, t.second, t.word))

CONTOUR = [
    trap("RND", word("RND=5"), EITHER, f"{START} L15,0,0 A20,5,0@15,5,+ L20,20,0 L0,20,0 R0,20,5"),
    trap("CHR", word("CHR=4"), EITHER, f"{START} L16,0,0 L20,4,0 L20,20,0 L0,20,0 R0,20,5"),
    # CHF is the length of the chamfer itself.
    trap("CHF", word("CHF=2.8284271247"), EITHER, f"{START} L18,0,0 L20,2,0 L20,20,0 L0,20,0 R0,20,5"),
    trap("RND then CHR", body("G1 X20 RND=5\nY20 CHR=4\nX0\nG64 ADIS=0.05\nG0 Z5"), EITHER,
         f"{START} L15,0,0 A20,5,0@15,5,+ L20,16,0 L16,20,0 L0,20,0 R0,20,5"),
    trap("RNDM", body("G1 X20 RNDM=2\nY20\nX0 RNDM=0\nG0 Z5"), EITHER,
         f"{START} L18,0,0 A20,2,0@18,2,+ L20,18,0 A18,20,0@18,18,+ L0,20,0 R0,20,5"),
    trap("RND has no room", word("RND=25"), REFUSED),
    trap("RND with its own feed", word("RND=5 FRC=200"), EITHER,
         f"{START} L15,0,0 A20,5,0@15,5,+f200 L20,20,0 L0,20,0 R0,20,5"),
    trap("ANG", second("ANG=90 Y20"), EITHER, SQUARE),
    trap("ANG=45", second("G1 ANG=45 Y20"), EITHER, f"{START} L20,0,0 L40,20,0 L0,20,0 R0,20,5"),
    trap("two ANG", body("G1 X20\nANG=135\nX0 Y20 ANG=180\nG0 Z5"), EITHER,
         f"{START} L20,0,0 L0,20,0 R0,20,5"),
    trap("G111", second("G111 X10 Y10\nG1 AP=90 RP=10"), EITHER, f"{START} L20,0,0 L10,20,0 L0,20,0 R0,20,5"),
    trap("G110", second("G110 X-10 Y0\nG1 AP=90 RP=10"), EITHER, f"{START} L20,0,0 L10,10,0 L0,10,0 R0,10,5"),
    trap("G112 of Siemens", second("G111 X10 Y0\nG112 X0 Y10\nG1 AP=90 RP=10"), EITHER,
         f"{START} L20,0,0 L10,20,0 L0,20,0 R0,20,5"),
    trap("AP=IC", second("G111 X0 Y0\nG1 AP=0 RP=20\nG1 AP=IC(90)"), EITHER,
         f"{START} L20,0,0 L0,20,0 R0,20,5"),
    trap("an arc with AP", second("G111 X0 Y0\nG3 AP=90 RP=20\nG1"), EITHER,
         f"{START} L20,0,0 A0,20,0@0,0,+ R0,20,5"),
    trap("AP without a pole", second("G1 AP=90 RP=20"), EITHER,
         f"{START} L20,0,0 L0,20,0 R0,20,5"),
    trap("CR", second("G3 Y20 CR=10\nG1"), EITHER, f"{START} L20,0,0 A20,20,0@20,10,+f? L0,20,0 R0,20,5"),
    trap("AR", second("G3 I-20 J0 AR=90\nG1"), EITHER, f"{START} L20,0,0 A0,20,0@0,0,+f? R0,20,5"),
    trap("CIP", second("CIP X20 Y20 I1=25 J1=10\nG1"), EITHER,
         f"{START} L20,0,0 A20,20,0@12.5,10,+ L0,20,0 R0,20,5"),
    trap("CT", second("CT X20 Y20\nG1"), EITHER, f"{START} L20,0,0 A20,20,0@20,10,+ L0,20,0 R0,20,5"),
    trap("X=AC", body("G91 G1 X=AC(20)\nY20\nX=AC(0)\nG90 G0 Z5"), READ, SQUARE),
    trap("X=IC", body("G1 X=IC(20)\nY=IC(20)\nX0\nG0 Z5"), READ, SQUARE),
    trap("X=20", body("G1 X=20\nY=10+10\nX=0\nG0 Z5"), READ, SQUARE),
    trap("R parameters", body("R1=20\nG1 X=R1\nY=R1\nX0\nG0 Z5"), READ, SQUARE),
    *words(REFUSED, "R2", "ALF=30", "OFFN=1", "DISR=5", "POS[Z]=10", "POSA[Z]=10", "UPATH=3", "I1=5", "CC=5", "RND",
           "A3=1 B3=0 C3=0", "FLIN", "Y1EX2", "ZZ=5", "X=DC(5)", "AP=5", "RP=5", "Q2", "I5 J3"),
    *words(EITHER, "G64 ADIS=0.05", "G641 ADIS=0.5", "G642", "D1", "M=8", "H=5", "H1=5", "G9", "S1=2000", "M1=3",
           "S2000 M3"),
    trap("FB is one block's feed", word("FB=300"), EITHER, f"{START} L20,0,0f300 {LAST}"),
    trap("FRCM", body("FRCM=200\nG1 X20 RND=5\nY20\nX0\nG0 Z5"), EITHER,
         f"{START} L15,0,0 A20,5,0@15,5,+f200 L20,20,0 L0,20,0 R0,20,5"),
]  # fmt: skip
assert SQUARE.endswith(LAST)

FRAMES = [
    trap("TRANS", block("TRANS X10"), EITHER, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap("TRANS then ATRANS", block("TRANS X10\nATRANS X-5 Y1"), EITHER,
         f"{START} L20,0,0 L20,21,0 L5,21,0 R5,21,5"),
    trap("TRANS clears", block("TRANS X10\nTRANS"), EITHER, SQUARE),
    trap("ROT RPL", body("G1 X20\nROT RPL=90\nG1 X20 Y20\nX0\nROT\nG0 Z5"), EITHER,
         f"{START} L20,0,0 L-20,20,0 L-20,0,0 R-20,0,5"),
    trap("AROT RPL twice", body("G1 X20\nAROT RPL=45\nAROT RPL=45\nG1 X20 Y20\nX0\nROT\nG0 Z5"), EITHER,
         f"{START} L20,0,0 L-20,20,0 L-20,0,0 R-20,0,5"),
    trap("TRANS then AROT", body("G1 X20\nTRANS X10\nAROT RPL=90\nG1 X20 Y20\nX0\nTRANS\nG0 Z5"), EITHER,
         f"{START} L20,0,0 L-10,20,0 L-10,0,0 R-10,0,5"),
    trap("ROT X30", block("ROT X30"), EITHER,
         f"{START} L20,0,0 L20,17.320508076,10 L0,17.320508076,10 R0,14.820508076,14.330127019"),
    trap("G58 X10", block("G58 X10"), EITHER, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap("G59 X10", block("G59 X10"), EITHER, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap("MIRROR X0", block("MIRROR X0"), EITHER, f"{START} L20,0,0 L20,20,0 L0,20,0 R0,20,5"),
    trap("MIRROR X0, then X", second("MIRROR X0\nG1 X10 Y20"), EITHER,
         f"{START} L20,0,0 L-10,20,0 L0,20,0 R0,20,5"),
    trap("SCALE X2", second("SCALE X2\nG1 X10 Y20"), EITHER, f"{START} L20,0,0 L20,20,0 L0,20,0 R0,20,5"),
    *blocks(REFUSED, "G55", "G505", "G500", "G599", "TOROT", "TOFRAME", "PAROT", "TRAANG", "TRAANG(45)", "TRANSMIT",
            "TRACYL(40)", "TCARR=1", "TOFFL=1", "MEAS=1", "$P_UIFR[1,X,TR]=10", "$P_PFRAME=CTRANS(X,10)",
            "ROTS X10 Y20", "CROTS X30 Y5", "D0", "ASCALE X2", "AMIRROR Y0", "G291",
            "TRACON(1)", "TOFFON(Z,1)", "CUTMOD=1"),
    *blocks(EITHER, "ORIWKS", "ORIVECT", "G290", "DIAMOF", "TRAFOOF", "KONT", "NORM", "G450", "CFC", "CFIN",
            "CUT2D", "TCOABS", "TOROTOF", "PAROTOF", "CYCLE800()", "ROT", "SCALE", "MIRROR", "G60", "G54"),
    trap("DIAMON", second("DIAMON\nG1 Y20\nX15"), EITHER,
         f"{START} L20,0,0 L20,20,0 L7.5,20,0 L0,20,0 R0,20,5"),
    trap("DIAM90", second("DIAM90\nG1 Y20\nG91 X-5\nG90 X20"), EITHER,
         f"{START} L20,0,0 L20,20,0 L15,20,0 L10,20,0 L0,20,0 R0,20,5"),
    trap("DIAMON then DIAMOF", second("DIAMON\nG1 Y20 X30\nDIAMOF\nX8"), EITHER,
         f"{START} L20,0,0 L15,20,0 L8,20,0 L0,20,0 R0,20,5"),
    trap("G70", second("G70\nG1 Y1\nG71"), EITHER, f"{START} L20,0,0 L20,25.4,0f? L0,25.4,0f? R0,25.4,5"),
    trap("G700", second("G700\nG1 Y1 F10\nG710 F600"), EITHER,
         f"{START} L20,0,0 L20,25.4,0f254 L0,25.4,0 R0,25.4,5"),
    trap("G710", block("G710"), EITHER),
]  # fmt: skip

HOLE = "R10,10,5 R10,10,2 L10,10,-3 R10,10,5"
OTHERS = [
    *blocks(REFUSED, "MYSUB", "MYCYCLE(1,2)", 'EXTCALL("A")', 'CALL "A"', 'CALL("A")', "L100", "L100 P3", "MYSUB P3",
            "P3 MYSUB", "M98 P100", "HOLES1(0,0,0,10,10,3)", "HOLES2(0,0,5,0,60,6)", "SLOT1(5,0,1,-5,3,20,0,0,5)",
            "POCKET3(5,0,1,-5,20,20,2,0,0,0,5,0,0,100,100,0,11)", "CYCLE72(\"C1\",5,0,1,-5)", "CYCLE76(5,0,1)",
            "CYCLE61(5,0,1,-5,0,0,20,20)", "CYCLE978(0,0)", "LONGHOLE(5,0,1,-5)", "CYCLE84(5,0,1,-5)",
            "REPEAT ANFANG ENDE", "GOTOF WEITER", "GOTOB ANFANG", "IF R1==0 GOTOF WEITER", "CASE R1 OF 1 GOTOF A",
            "FOR R1=1 TO 3", "WHILE R1<3", "LOOP", "WHEN $AA_IW[Z]>5 DO POS[Z]=5", "ID=1 WHENEVER $AA_IW[X]>5 DO M8",
            "FGROUP(X,Y)", "OVR=50", "FZ=0.1", "FCUB", "G63 Z-5", "G331 Z-5 K1", "G33 Z-5 K1", "G34 Z-5 K1 F0.1",
            "G75 Z1=0", "G74 Z1=0", "G147 DISR=5 X30", "G247 DISR=5", "INVCW X30 CR=5", "BSPLINE", "ASPLINE", "CSPLINE",
            "POLY PO[X]=(5)", "PTP", "PTPG0", "SPOSA=0 X", "TURN=2", "G931 F5", "G42 D1",
            "G41 D1", "M136", "MOV[X]=1", "SBLOF X"),
    *blocks(READ, "STOPRE", 'MSG("X50 Y50 G1")', "G641", "FFWON", "SOFT", "BRISK", "G4 F2", "M8", "CYCLE832()",
            "; X50", "G40", "G17", "G64", "G601", "MCALL"),
    *blocks(EITHER, "CYCLE832(0.05,1,1)", 'MSG("A (B) ; C")', "COMPCAD", "COMPOF", "DEF REAL A", "ANFANG:", "SPOS=0",
            "LIMS=5000", "SETAL(65000)", "G25 X0 Y0", "G26 X99 Y99", "ACC[X]=50", "FNORM", "CP", "SPATH", "G96 S100",
            "G97 S1000", 'T="MILL"', "WALIMON", "GROUP_BEGIN(0,\"A\",0,0)", "SETMS(1)",
            "G0 RTLIOF\nG1", "WORKPIECE(,,,\"BOX\")"),
    trap("M17 ends it", block("M17"), EITHER, f"{START} L20,0,0"),
    trap("RET ends it", block("RET"), EITHER, f"{START} L20,0,0"),
    trap("CYCLE81", body("G0 Z5\nX10 Y10 F600\nCYCLE81(5,0,2,-3)\nG0 X0 Y0 Z5"), READ,
         f"{START} R0,0,5 {HOLE} R0,0,5"),
    trap("MCALL CYCLE81", body("G0 Z5\nMCALL CYCLE81(5,0,2,-3)\nX10 Y10 F600\nX20\nMCALL\nG0 X0 Y0 Z5"), READ,
         f"{START} R0,0,5 {HOLE} R20,10,5 R20,10,2 L20,10,-3 R20,10,5 R0,0,5"),
    trap("MCALL CYCLE82", body("G0 Z5\nMCALL CYCLE82(5,0,2,-3,,1)\nX10 Y10 F600\nMCALL\nX20\nG0 X0 Y0 Z5"), READ,
         f"{START} R0,0,5 {HOLE} R20,10,5 R0,0,5"),
    trap("L in the file", "%_N_PART_MPF\n" + block("L100 P3") + "%_N_L100_SPF\nG91 G1 Y5\nG90\nM17\n", EITHER,
         f"{START} L20,0,0 L20,5,0 L20,10,0 L20,15,0 {LAST}"),
    trap("a name in the file", "%_N_PART_MPF\n" + block("SIDE") + "%_N_SIDE_SPF\nG91 G1 Y5\nG90\nRET\n", EITHER,
         f"{START} L20,0,0 L20,5,0 {LAST}"),
    t.machine("SUPA G0 Z0 D0", "mpf"), t.machine("G0 SUPA Z0", "mpf"), t.machine("G153 G0 Z0", "mpf"),
    t.machine("G53 G0 Z0 D0", "mpf"), t.machine("G0 G53 Z0", "mpf"),
]  # fmt: skip

TRAPS: list[t.Trap] = [*CONTOUR, *FRAMES, *OTHERS]
