enum { CHART_AT_LEAST, CHART_AFTER, CHART_EVERY, CHART_WITHIN };
enum { CHART_MAX_MICROSTEPS = 1000, CHART_MAX_EVENTS = 1000 };

/* A state, a region, a history or, at index 0, the plot; blocks of actions have numbers, 0 is none. */
struct chart_node {
    int parent, last, initial;
    bool state, orthogonal, transparent, final;
    int memory; /* of a history; -1 for other nodes */
    bool deep;
    int default_node, default_block;
    int entry, leave, broken, outcome;
    bool waits;
    int done;
    bool immediate;
    int trigger, triggers; /* first and number of its triggers */
};

/* A transition between nodes; an edge with `each` reports the failure of its guard for each event. */
struct chart_edge {
    int source, target, targets, guard, effect; /* first and number of its targets */
    bool internal, each;
    int clear, cleared; /* first and number of the memories that it clears */
};

struct chart_trigger {
    int event, edge;
};

/* A timer of a node with its edge or, for CHART_WITHIN, its activity. */
struct chart_timer {
    int kind, node, edge, activity;
};

/* An activity of a node, with its timer of kind CHART_WITHIN; -1 is none. */
struct chart_activity {
    int node, timer;
};

static void chart_fail(struct chart *c, int failure);
static void chart_fire_event(struct chart *c, int event, const struct chart_attributes *data);
static void chart_arm(struct chart *c, int timer);
