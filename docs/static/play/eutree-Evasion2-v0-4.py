def play(x):return (1 if x[0]<=15.898585950036091 else 0 if x[2]<=7.273080197951866 else 1) if x[0]<=18.043165089314464 else 1
