def play(x):return (0 if x[5]<=-1.583102822303772 else 2) if x[4]<=-0.09116289019584656 else 0 if x[5]<=1.8670039176940918 else 2
