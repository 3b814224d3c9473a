def play(x):return (3 if x[8]<=-0.0625069277593866 else 2 if x[3]<=-0.18322397023439407 else 1) if x[7]<=0.5 else 0
