/* Parking of parking.h, with the names used there: one reader, one or two producers, each with a small input of its
 * own. Runs are endless, and a producer may stop for ever. What ready() looks at is a count per producer, published
 * by it and visible to the reader some time later (memory below), but at the latest when the reader has acquired it
 * through the word. A sleeping reader looks at nothing, so a wake-up that relies on luck is found. All counts are
 * relative to what the reader has taken, which keeps them small.
 *
 * The count of notifications in the word matters only as "has the word changed since fetch_or?", so the model keeps
 * that bit instead; what it leaves out is 2^31 notifications between fetch_or and the kernel's look at the word.
 *
 * The kernel: futex_wait compares the word and goes to sleep in one step, but the comparison may miss a change
 * whose futex_wake it has not been told of yet; futex_wake wakes whoever sleeps; a sleeper may wake for no reason.
 * There is no deadline: a watchdog must not be what wakes the reader.
 *
 * Checked: no element waits for ever while the reader sleeps (each input is emptied, or taken from, again and
 * again).
 * Left out: the counters, and what wait_until() does at its deadline. */
#ifndef PRODUCERS
#define PRODUCERS 2
#endif
#ifndef kRoom
#define kRoom 2 /* elements in an input; a full one refuses */
#endif
#define RELAXED 0
#define ACQUIRE 1
#define RELEASE 2

#ifndef kNotify /* fetch_add in notify() */
#define kNotify RELEASE
#endif
#ifndef kPark /* fetch_or in wait_until() */
#define kPark ACQUIRE
#endif
#ifndef SECOND_LOOK
#define SECOND_LOOK 1
#endif
#ifndef NOTIFY_FIRST /* 1: counts before it publishes */
#define NOTIFY_FIRST 0
#endif

bit parked;        /* kParked in word_ */
bit changed;       /* word_ is no longer the one that fetch_or left */
bit told;          /* some futex_wake came after fetch_or */
bit sleeping;      /* in the kernel, waiting for a wake-up */

byte published[PRODUCERS]; /* elements in each input */
byte visible[PRODUCERS];   /* of these, what the reader sees when it looks */
byte carried[PRODUCERS];   /* of these, what the newest message of word_ carries */
bit taken[PRODUCERS];      /* changes whenever the reader takes an element */

inline publish(me) {
  atomic {
    if
    :: published[me] < kRoom -> published[me]++
    :: else
    fi
  }
}

inline notify(me) {
  atomic {
    wake = parked;
    changed = 1;
#if kNotify == RELEASE
    carried[me] = published[me]
#endif
  };
  if
  :: wake -> atomic { told = 1; sleeping = 0 }
  :: else
  fi
}

active [PRODUCERS] proctype producer() {
  bit wake;
  byte me = _pid;
  do
  :: if
     :: skip /* it may as well produce nothing any more */
     :: goto stopped
     fi;
#if NOTIFY_FIRST
     notify(me);
     publish(me)
#else
     publish(me);
     notify(me)
#endif
  od;
stopped:
  skip
}

/* ready(): looks at one input after the other. */
inline look() {
  came = 0;
  k = 0;
  do
  :: k < PRODUCERS ->
     atomic {
       came = came || visible[k] > 0;
       k++
     }
  :: else -> k = 0; break
  od
}

/* Stores reach the reader some time. */
active [PRODUCERS] proctype memory() {
  byte me = _pid - PRODUCERS;
end_nothing_new:
  do
  :: atomic { visible[me] < published[me] -> visible[me]++ }
  od
}

active proctype reader() {
  bit came;
  byte k;
  do
  :: /* wait_until() */
     look();
     if
     :: came -> goto found
     :: else
     fi;
     atomic {
       parked = 1;
       changed = 0;
       told = 0;
#if kPark == ACQUIRE
       k = 0;
       do
       :: k < PRODUCERS ->
          if
          :: carried[k] > visible[k] -> visible[k] = carried[k]
          :: else
          fi;
          k++
       :: else -> break
       od;
#endif
       k = 0
     };
#if SECOND_LOOK
     look();
#endif
     if
     :: came -> skip
     :: !came && changed -> skip /* futex_wait finds another word */
     :: !came -> skip            /* it sleeps, and wakes for no reason, some time */
     :: atomic { !came && (!changed || !told) -> sleeping = 1 };
end_asleep: /* no wrong place to end; whether the inputs are empty is said below */
        !sleeping
     fi;
     atomic { parked = 0; changed = 1 }; /* fetch_and */
     if
     :: came -> skip
     :: else -> goto again
     fi;
found:
     /* the thread empties its inputs as far as it sees them */
     k = 0;
     do
     :: k < PRODUCERS ->
        atomic {
          if
          :: visible[k] > 0 ->
             assert(published[k] > 0);
             published[k]--;
             visible[k]--;
             taken[k] = !taken[k];
             carried[k] = (carried[k] > 0 -> carried[k] - 1 : 0)
          :: else
          fi;
          k++
        }
     :: else -> k = 0; break
     od;
again:
     skip
  od
}

#define served(input) (([] <> (published[input] == 0)) || (([] <> taken[input]) && ([] <> !taken[input])))
ltl no_lost_wake_up { served(0) && served(PRODUCERS - 1) }
