def play(x):return ((0 if x[1]<=-5.300162798397977 else 1) if x[3]<=2.7124172444684076 else 0) if x[0]<=0.0 else 1
