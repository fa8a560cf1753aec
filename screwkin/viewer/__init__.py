"""What is seen of a robot and its motion, as data; and the browser viewer that shows it."""
