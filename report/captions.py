"""What to see in each figure, in a sentence or two."""

CAPTIONS: dict[str, str] = {
    "hallway": (
        "The hallway at one recorded moment. Each ochre dot is a walking person; its arrow points "
        "where the person walks and is as long as 0.7 s of walking; fading lines are the last "
        "seconds of the path. People keep to the right. The robot is the large purple dot; its "
        "white line points forward. It starts in a dashed area and has to reach the green one."
    ),
    "visitation": (
        "Where the demonstrations took their decisions (darker: more often), with the recorded "
        "tracks as thin lines. Pale cells were never visited: there the model knows only what the "
        "reward and the shared outcome models tell it."
    ),
    "policy": (
        "What the robot was told to do: the best action of each cell as an arrow (a dot means "
        "wait) on the value of the cell (darker: better). Cells framed in dashed red are traps: "
        "from there the arrows never lead to the goal."
    ),
    "arrival": (
        "Share of episodes that have arrived by each time. The dashed blue curve was computed "
        "from the learned model before driving; the red one was measured. Bands hold 95 % at each "
        "time by itself: blue, where the share of that many episodes would fall if the model were "
        "right; red, the exact confidence interval of the measured share. A good model keeps "
        "the red curve inside the blue band. The model counts whole decision periods; how far into "
        "the last one the robot arrives is taken from the demonstrations, and is its end where "
        "they do not tell."
    ),
    "weights": (
        "What the demonstrator seems to want: reward per unit of each feature. Blue bars attract, "
        "red bars repel. Compare a weight with how often its feature is met: a robot at "
        "the goal stays there and collects its weight for good."
    ),
    "outcomes": (
        "What happens to an intended move within one decision period, relative to its direction, "
        "in four situations: with the flow of people, against it, across it, and waiting. Hatched "
        "grey: counted from the demonstrations alone. Blue: after learning together with the "
        "reward. The fewer the decisions, the more the model may move away from the count."
    ),
    "features": (
        "The features the reward is made of, from -1 (blue) to 1 (red). The social norm depends "
        "on the action: 1 for going with the flow or waiting, -1 for going against it."
    ),
    "progress": (
        "How learning went: the log posterior after each step of the optimiser. It should rise "
        "and then level off."
    ),
}

TITLES: dict[str, str] = {
    "hallway": "The hallway",
    "visitation": "Demonstrations",
    "policy": "Learned strategy",
    "arrival": "Time of arrival, predicted and measured",
    "weights": "Learned reward",
    "outcomes": "Learned dynamics",
    "features": "Features",
    "progress": "Learning progress",
}
