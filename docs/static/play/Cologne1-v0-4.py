def play(x):return (0 if ((x[2]+x[6])-(x[0]+x[4]))<=7.5 else 2) if x[10]<=0.5 else 0 if ((x[2]+x[6])-(x[0]+x[4]))<=-1.5 else 2
