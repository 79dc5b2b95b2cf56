/PROG  WELD
/ATTR
COMMENT		= "example";
LINE_COUNT	= 6;
/APPL
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:J P[1] 100% FINE    ;
   4:L P[2] 500mm/sec CNT50    ;
   5:L P[3:seam] 10mm/sec FINE    ;
   6:C P[4]    
    :  P[5] 10mm/sec FINE    ;
   7:L P[3] 10mm/sec FINE Offset,PR[1]    ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,	
	J1=    40.493 deg,	J2=    22.496 deg,	J3=    53.112 deg,
	J4=   -51.528 deg,	J5=   -31.710 deg,	J6=    96.437 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =  -839.864  mm,	Y =   306.237  mm,	Z =  3049.055  mm,
	W =     1.665 deg,	P =    14.305 deg,	R =    51.466 deg
};
P[3:"seam"]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'F U T, 0, 0, 0',
	X =   620.962  mm,	Y =  1462.359  mm,	Z =  1552.109  mm,
	W =    31.349 deg,	P =   -47.887 deg,	R =  -171.064 deg
};
P[4]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'F U T, 0, 0, 0',
	X =   945.543  mm,	Y =  1078.781  mm,	Z =   452.880  mm,
	W =  -126.839 deg,	P =    10.122 deg,	R =   -83.010 deg
};
P[5]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'F U T, 0, 0, 0',
	X =   841.194  mm,	Y =  1050.537  mm,	Z =  1232.580  mm,
	W =    50.747 deg,	P =   -50.591 deg,	R =   140.632 deg
};
/END
